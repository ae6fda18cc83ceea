"""Draw the maps that are shipped to try the planner on: maps/depot, office, house and hospital.

They look as a robot's maps do: what a laser sees of a building, at 0.05 m a cell, with rough
edges and with unknown cells behind them. Run it with `python -m benchmarks.make_robot_maps`; it
writes NAME.pgm, NAME.yaml and NAME.places.geojson, the same bytes every time. Lengths are metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.grid_map import FREE, OCCUPIED, UNKNOWN, GridMap, Pose2D
from numpy.typing import NDArray
from shapely.affinity import rotate

from benchmarks.make_instruction_maps import MAPS, Drawing, Rectangle, save

# Cells of a surface that a laser marks, and the share of those before it that its noise does.
SEEN = 2
NOISE = 0.08
# What map_server takes for free; the shade 205 of unknown cells is just above it.
FREE_THRESH = 0.196
Cells = NDArray[np.bool_]


@dataclass
class Building(Drawing):
    """A building under construction, solid where no room is; its corner is at `origin`."""

    resolution: float = 0.05

    def __post_init__(self) -> None:
        """Make a solid block."""
        super().__post_init__()
        self.cells[:] = OCCUPIED

    def room(
        self, name: str, area: Rectangle, kind: str = 'room', aliases: str = '', tags: str = ''
    ) -> None:
        """Carve a room, and make it a place."""
        self.doors([area])
        self.place(name, area, kind, aliases, tags)

    def put(self, *areas: Rectangle, turn: float = 0.0) -> None:
        """Put what is solid into a room, turned by degrees about its centre."""
        rows, columns = np.mgrid[: self.cells.shape[0], : self.cells.shape[1]]
        x, y = ((at + 0.5) * self.resolution for at in (columns, rows))
        for area in areas:
            self.cells[shapely.contains_xy(rotate(shapely.box(*area), turn), x, y)] = OCCUPIED

    def put_legs(self, *areas: Rectangle, turn: float = 0.0) -> None:
        """Put tables, of which a laser sees the legs."""
        for x0, y0, x1, y1 in areas:
            table = rotate(shapely.box(x0, y0, x1, y1), turn)
            for x, y in shapely.get_coordinates(table)[:4]:
                self.put_columns((x, y), width=0.1)

    def put_columns(self, *points: tuple[float, float], width: float = 0.5) -> None:
        """Put square columns."""
        half = width / 2
        self.put(*((x - half, y - half, x + half, y + half) for x, y in points))

    def grid_map(self) -> GridMap:
        """Return the map that a robot makes of the building, the same every time."""
        solid = self.cells == OCCUPIED
        edge = solid & grown(~solid, SEEN)
        random = np.random.Generator(np.random.PCG64(1))
        edge |= ~solid & grown(solid, 1) & (random.random(solid.shape) < NOISE)
        cells = np.select([edge, solid], [OCCUPIED, UNKNOWN], FREE).astype(np.int8)
        return GridMap(cells, self.resolution, self.origin)

    def save(self, folder: Path) -> None:
        """Write the image, the yaml file and the places."""
        save(folder, self.name, self.grid_map(), self.places, FREE_THRESH)


def grown(cells: Cells, by: int) -> Cells:
    """Return cells [height, width] with all within `by` rows and columns of them."""
    found = np.pad(cells, by)
    for axis in (0, 1):
        found = np.logical_or.reduce([np.roll(found, at, axis) for at in range(-by, by + 1)])
    return found[by:-by, by:-by]


def depot() -> Building:
    """Draw a hall with racks, docks and a parked forklift, and rooms beside it."""
    made = Building('depot', 31, 17, origin=Pose2D(-8.0, -5.0))
    made.doors([(0.5, 0.5, 23, 16.5), *((0.3, y, 0.5, y + 2.4) for y in (1.4, 5.4, 9.4))])
    made.room('workshop', (23.2, 9.2, 30.5, 16.5), 'room', 'Werkstatt,atelier,taller')
    made.room('dispatch office', (23.2, 5.2, 30.5, 9), 'room', 'office,Büro,bureau,oficina')
    made.room('battery room', (23.2, 0.5, 30.5, 5), 'room', 'batteries,Batterieraum')
    made.doors([(23, 12, 23.2, 14.4), (23, 6.4, 23.2, 7.8), (23, 1.8, 23.2, 3.8)])
    made.doors([(28, 9, 29.4, 9.2), (28, 5, 29.4, 5.2)])
    made.fill([(x, y, x + 0.4, y + 0.3) for x in (4.6, 10, 15.4) for y in (0.5, 16.2)])
    for name, low in (('A', 3), ('B', 6.2), ('C', 9.4)):
        made.object(f'rack {name}', (7, low, 18, low + 1.2), f'Regal {name}', 'rack')
    made.doors([(12, 6.2, 14, 7.4)])
    made.place('gap in rack B', (12, 6.2, 14, 7.4), 'gap', 'gap')
    for number, low in ((1, 4.2), (2, 7.4)):
        names = f'Gang {number},allée {number},pasillo {number}'
        made.place(f'aisle {number}', (7, low, 18, low + 2), 'aisle', names, 'narrow')
    for number, low in enumerate((1, 5, 9), start=1):
        made.place(f'dock {number}', (0.5, low, 4.2, low + 3.2), 'dock', f'gate {number}')
    made.place('charging station', (0.5, 14.2, 3, 16.5), 'area', 'charger,Ladestation,chargeur')
    made.put((0.5, 14.8, 0.8, 15.2), (0.5, 15.6, 0.8, 16))
    made.place('staging area', (18.8, 0.5, 23, 5), 'area', 'staging,Bereitstellung')
    made.put((20.2, 1, 21.4, 2), (20.1, 2.8, 21.3, 3.8), turn=4)
    made.put((9.5, 12.9, 14.5, 13.6), (14.3, 13, 15, 15))
    made.place('conveyor', (9.5, 12.9, 15, 15), 'area', 'belt,Förderband')
    made.place('forklift', (5.1, 11.6, 7.1, 13.2), 'object', 'truck,Stapler,chariot')
    made.put((5.2, 12, 6.4, 12.9), turn=35)
    made.put((6.3, 12.5, 7.4, 12.62), (6.1, 12.9, 7.2, 13.02), turn=35)
    made.put_columns((4.8, 4.7), (20.4, 7.2), (20.4, 11.6), (8, 14.9))
    made.put((18.2, 14.2, 19.4, 15.2), turn=-12)
    made.put_legs((17.2, 11.9, 19, 12.8))
    made.put((24, 15.7, 27, 16.5), (29.7, 11, 30.5, 14.6), (24.6, 10, 25.4, 10.8))
    made.put_legs((26, 12, 28, 13.2), (25, 6.8, 26.6, 7.6))
    made.put_legs((25.4, 6, 25.8, 6.4), turn=20)
    made.put((29.8, 6, 30.5, 8.4), *((x, 0.5, x + 0.8, 1.1) for x in (24, 25.4, 26.8, 28.2)))
    return made


def office() -> Building:
    """Draw an office floor: an open space with desks, and rooms around it."""
    made = Building('office', 26, 16, origin=Pose2D(-3.0, -2.5))
    made.room('open space', (6.2, 0.4, 19.8, 9.6), 'area', 'open-plan area,espacio abierto')
    made.room('corridor', (0.4, 9.8, 25.6, 11.4), 'corridor', 'Flur,couloir,pasillo')
    made.doors([(x, 9.6, x + 2, 9.8) for x in (8, 16)])
    for name, x0, x1, aliases in (
        ('big meeting room', 0.4, 6.6, 'boardroom,großer Besprechungsraum,grande salle'),
        ('small meeting room', 6.8, 10.4, 'kleiner Besprechungsraum,petite salle'),
        ('kitchenette', 10.6, 14.4, 'kitchen,coffee kitchen,Teeküche,cocina'),
        ('server room', 14.6, 17.6, 'servers,Serverraum,salle des serveurs'),
        ('toilets', 17.8, 21, 'restrooms,WC'),
        ('quiet room', 21.2, 25.6, 'library,Ruheraum'),
    ):
        made.room(name, (x0, 11.6, x1, 15.6), 'room', aliases)
        made.doors([(x0 + 1, 11.4, x0 + 2.1, 11.6)])
    made.doors([(6.6, 14, 6.8, 15)])
    for name, y0, y1, aliases in (
        ('reception', 0.4, 4.8, 'front desk,Empfang,recepción'),
        ('post room', 5, 9.6, 'mail room,Poststelle'),
    ):
        made.room(name, (0.4, y0, 6, y1), 'room', aliases)
        made.doors([(6, y0 + 1.6, 6.2, y0 + 2.9)])
    made.doors([(2, 9.6, 3.2, 9.8)])
    for name, y0, y1, aliases in (
        ("director's office", 0.4, 4.8, 'boss,Direktion'),
        ('accounts', 5, 9.6, 'accounting,Buchhaltung'),
    ):
        made.room(name, (20, y0, 25.6, y1), 'office', aliases)
        made.doors([(19.8, y0 + 1.4, 20, y0 + 2.5)])
    made.doors([(22, 9.6, 23.2, 9.8)])
    for number, x in enumerate((8.2, 11.8, 15.4), start=1):
        for low in (1.6, 5.2):
            made.put((x, low, x + 2, low + 0.2))
            made.put_legs((x, low - 0.7, x + 2, low + 0.9))
            for left, chair in ((x + 0.7, low - 1), (x + 0.9, low + 0.8)):
                made.put((left, chair, left + 0.4, chair + 0.4), turn=20 * number)
        area = (x - 0.1, 0.5, x + 2.1, 6.6)
        made.place(f'desks {number}', area, 'object', f'desk block {number}', 'desks')
    made.object('sofa', (18.9, 7.4, 19.8, 9.2), 'couch,canapé')
    made.put_legs((18, 8, 18.5, 8.6))
    made.put_columns((7.4, 7.8), (13, 8.4), width=0.4)
    made.object('printer', (0.4, 7.4, 1.2, 8.4), 'copier,Drucker')
    made.put((3, 1.6, 3.6, 3.8), (4.8, 8.9, 6, 9.6), (24.8, 0.6, 25.6, 2.4))
    made.put_legs((2, 13, 5, 14.4), (7.8, 13.2, 9.2, 14.6), (22, 2, 23.8, 2.9), (22, 6, 23.8, 6.9))
    made.put((2.4, 12.5, 2.8, 12.9), (4.2, 12.5, 4.6, 12.9), (3.2, 14.6, 3.6, 15), turn=15)
    made.put((10.6, 15, 14.4, 15.6), (15.2, 13, 16, 15), (16.6, 13, 17.4, 15))
    made.put((19.4, 13.4, 19.5, 15.6), (19.5, 13.4, 21, 13.5), (23, 14.8, 25.6, 15.6))
    return made


def house() -> Building:
    """Draw a bungalow with furniture, and rooms on both sides of a hall."""
    made = Building('house', 15, 11, origin=Pose2D(-1.0, -1.0))
    made.room('hall', (0.4, 4.6, 13, 6), 'hall', 'hallway,corridor,Flur,couloir,pasillo')
    made.room('entrance', (13, 4.6, 14.6, 6), 'hall', 'front door,Haustür,entrée,entrada')
    for name, x0, x1, door, aliases, tags in (
        ('kitchen', 0.4, 4.2, 2.4, 'Küche,cuisine,cocina', ''),
        ('dining room', 4.4, 8, 6.2, 'Esszimmer,salle à manger,comedor', ''),
        ('living room', 8.2, 14.6, 9.6, 'lounge,Wohnzimmer,salon,sala', 'carpet'),
    ):
        made.room(name, (x0, 0.4, x1, 4.4), 'room', aliases, tags)
        made.doors([(door, 4.4, door + 1, 4.6)])
    for name, x0, x1, door, aliases, tags in (
        ('bedroom', 0.4, 4.4, 3, 'Schlafzimmer,chambre,dormitorio', 'carpet'),
        ("children's room", 4.6, 8.2, 5, 'nursery,Kinderzimmer', 'carpet'),
        ('bathroom', 8.4, 10.8, 9, 'Bad,salle de bain,baño', ''),
        ('study', 11, 14.6, 11.6, 'home office,Arbeitszimmer,estudio', ''),
    ):
        made.room(name, (x0, 6.2, x1, 10.6), 'room', aliases, tags)
        made.doors([(door, 6, door + 1, 6.2)])
    made.doors([(4.2, 1.6, 4.4, 2.8), (8, 1.4, 8.2, 3.2), (4.4, 7, 4.6, 8)])
    made.put((0.4, 0.4, 1, 3.6), (1, 0.4, 2.8, 1))
    made.put_legs((5.4, 1.6, 7, 2.8))
    made.put_legs((5, 1.8, 5.3, 2.2), (7.1, 2.2, 7.4, 2.6), (5.9, 3, 6.3, 3.3))
    made.object('sofa', (11, 0.4, 13.4, 1.3), 'couch,canapé')
    made.put_legs((11.6, 1.9, 12.8, 2.6))
    made.put((14.1, 2, 14.6, 3.8), (9, 0.4, 9.9, 1.3))
    made.place('dog basket', (8.3, 3.5, 9.1, 4.3), 'object', 'dog,Hundekorb')
    made.put((8.4, 3.6, 9, 4.2), turn=20)
    made.object('bed', (0.4, 8, 2.4, 9.8), 'double bed,Bett,lit,cama')
    made.put((3.8, 9, 4.4, 10.6), (4.6, 9.8, 6.6, 10.6), (7.6, 7, 8.2, 8.6))
    made.put((6.2, 7.6, 6.5, 7.9), (7, 9.3, 7.25, 9.5), turn=30)
    made.put((8.4, 10, 10.8, 10.6), (10.2, 7.4, 10.8, 8.2), (8.4, 8.6, 8.9, 9.1))
    made.put_legs((12.4, 9.6, 14.2, 10.4))
    made.put((13, 8.9, 13.4, 9.3), (14.2, 6.4, 14.6, 9))
    made.put((0.4, 4.6, 0.8, 5.4), (13.2, 5.75, 14.2, 6))
    return made


def hospital() -> Building:
    """Draw a ward: rooms with beds on both sides of two corridors, and a block between them."""
    made = Building('hospital', 34, 20, origin=Pose2D(-12.0, -10.0))
    for name, low, aliases in (
        ('south corridor', 5.2, 'Südflur,couloir sud,pasillo sur'),
        ('north corridor', 12.4, 'Nordflur,couloir nord,pasillo norte'),
    ):
        made.room(name, (0.4, low, 33.6, low + 2.4), 'corridor', aliases)
    made.room('west link', (0.4, 7.6, 2.6, 10), 'corridor')
    made.room('lift lobby', (0.4, 10, 2.6, 12.4), 'corridor', 'lift,elevator,Aufzug,ascenseur')
    made.room('east link', (31.4, 7.6, 33.6, 12.4), 'corridor')
    made.room('passage', (15.8, 7.6, 18, 12.4), 'corridor', 'central passage,Durchgang')
    for number in range(6):
        x = 0.4 + 5.55 * number
        tags = 'isolation' if number in (2, 3) else ''
        for first, low, door, bed in ((101, 0.4, 5, 0.4), (201, 15, 14.8, 17.4)):
            name = f'{first + number}'
            made.room(f'room {name}', (x, low, x + 5.4, low + 4.6), 'patient room', name, tags)
            made.doors([(x + 3.2, door, x + 4.6, door + 0.2)])
            made.put(*((x + at, bed, x + at + 0.95, bed + 2.1) for at in (0.5, 2.6)))
            made.put((x + 1.6, bed + 0.3, x + 2, bed + 0.7), turn=9 * number)
            made.fill([(x + 4.6, bed, x + 4.7, bed + 2.2)])
    for name, x0, x1, doors, aliases in (
        ("nurses' station", 2.8, 8.8, (4, 12.2), 'nurses station,nursing station'),
        ('pharmacy', 9, 15.6, (13.4, 7.6), 'Apotheke,pharmacie,farmacia'),
        ('treatment room', 18.2, 25, (20, 7.6), 'Behandlungsraum,salle de soins'),
        ('linen store', 25.2, 31.2, (28, 12.2), 'linen,Wäschekammer'),
    ):
        made.room(name, (x0, 7.8, x1, 12.2), 'room', aliases)
        made.doors([(doors[0], doors[1], doors[0] + 1.4, doors[1] + 0.2)])
    made.put((3.4, 9.4, 7.4, 10), (7, 8.4, 7.6, 10))
    made.put(*((x, 9, x + 0.6, 11.6) for x in (9.8, 11.2, 12.6)), (21, 9.6, 23, 10.4))
    made.put((25.8, 7.8, 31.2, 8.4), (26.4, 10, 27.8, 11), (24.2, 8, 25, 9.6))
    made.put((10.4, 7, 12.4, 7.6), (28.6, 5.2, 29.4, 5.9))
    made.object('parked bed', (22.2, 14.2, 24.3, 14.8), 'bed')
    made.put((6.2, 12.9, 7, 13.5), turn=25)
    return made


def make_maps(folder: Path) -> None:
    """Write all maps into a folder."""
    for draw in (depot, office, house, hospital):
        draw().save(folder)


if __name__ == '__main__':
    make_maps(MAPS)
