"""Draw the maps of the instruction suite, maps/instructions/, with their places.

Run it with `python -m benchmarks.make_instruction_maps`; it writes NAME.pgm, NAME.yaml and
NAME.places.geojson, the same bytes every time. Lengths are metres.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_map import find_barrier_map, load_barrier_maps
from llm_astar_msgs_adapter.maps.grid_map import ORIGIN, GridMap, Pose2D
from llm_astar_msgs_adapter.maps.places import Place
from numpy.typing import NDArray
from PIL import Image
from shapely import Point, box, get_coordinates

MAPS = Path(__file__).resolve().parents[1] / 'maps'
FOLDER = MAPS / 'instructions'
# (x0, y0, x1, y1), in the frame of the drawing: its lower left corner is (0, 0).
Rectangle = tuple[float, float, float, float]
# Barrier maps by id, with the names and aliases of their barriers, horizontal ones first.
BARRIERS = {
    0: ('wall A,long wall,mur A', 'wall B', 'wall C,pared C', 'wall D'),
    13: ('wall y=19', 'wall y=11', 'wall x=34', 'wall x=28'),
    15: ('south fence', 'middle fence', 'east fence', 'west fence'),
}
YAML = """image: {name}.pgm
mode: trinary
resolution: {map.resolution}
origin: [{map.origin.x}, {map.origin.y}, {map.origin.yaw}]
negate: 0
occupied_thresh: 0.65
free_thresh: {free}
"""


@dataclass
class Drawing:
    """A map under construction: a free floor of `width` by `height` within walls one cell thick.

    `origin` is the pose of the floor's lower left corner in the map's frame.
    """

    name: str
    width: float
    height: float
    resolution: float = 0.2
    origin: Pose2D = ORIGIN
    places: list[Place] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Make the floor and the outer walls."""
        shape = round(self.height / self.resolution), round(self.width / self.resolution)
        self.cells: NDArray[np.int8] = np.full(shape, 100, dtype=np.int8)
        self.cells[1:-1, 1:-1] = 0

    def fill(self, rectangles: Iterable[Rectangle], value: int = 100) -> None:
        """Set the cells whose centres lie in rectangles: 100 for walls, 0 for doors."""
        for x0, y0, x1, y1 in rectangles:
            left, low, right, high = (round(s / self.resolution) for s in (x0, y0, x1, y1))
            self.cells[low:high, left:right] = value

    def doors(self, rectangles: Iterable[Rectangle]) -> None:
        """Free the cells of doors."""
        self.fill(rectangles, 0)

    def place(
        self, name: str, area: Rectangle, kind: str = 'area', aliases: str = '', tags: str = ''
    ) -> None:
        """Add a place; `aliases` and `tags` are separated by commas."""
        split = [tuple(filter(None, text.split(','))) for text in (aliases, tags)]
        self.places.append(Place(name, box(*area), kind, split[0], split[1]))

    def object(self, name: str, area: Rectangle, aliases: str = '', tags: str = '') -> None:
        """Add a place that is an obstacle."""
        self.fill([area])
        self.place(name, area, 'object', aliases, tags)

    def grid_map(self) -> GridMap:
        """Return the map."""
        return GridMap(self.cells, self.resolution, self.origin)

    def save(self, folder: Path) -> None:
        """Write the image, the yaml file and the places, turned into the map's frame."""
        save(folder, self.name, self.grid_map(), self.places)


def save(
    folder: Path, name: str, grid_map: GridMap, places: Sequence[Place], free: float = 0.25
) -> None:
    """Write a map and its places, whose polygons are in the frame of the grid's corner.

    `free` is the map's free_thresh, below 0.196 where there are unknown cells.
    """
    cells = grid_map.cells[::-1]
    shades = np.select([cells > 0, cells < 0], [0, 205], 254).astype(np.uint8)
    Image.fromarray(shades).save(folder / f'{name}.pgm')
    text = YAML.format(name=name, map=grid_map, free=free)
    (folder / f'{name}.yaml').write_text(text, encoding='utf-8')
    lines = ',\n'.join(
        json.dumps(feature(place, grid_map), ensure_ascii=False) for place in places
    )
    text = f'{{"type": "FeatureCollection", "features": [\n{lines}\n]}}\n'
    (folder / f'{name}.places.geojson').write_text(text, encoding='utf-8')


def feature(place: Place, grid_map: GridMap) -> dict[str, object]:
    """Return the GeoJSON feature of a place that is drawn in the frame of the grid's corner."""
    single = isinstance(place.geometry, Point)
    corners = get_coordinates(place.geometry) / grid_map.resolution - 0.5
    turned = grid_map.grid_to_world(corners).round(3).tolist()
    return {
        'type': 'Feature',
        'geometry': {
            'type': place.geometry.geom_type,
            'coordinates': turned[0] if single else [turned],
        },
        'properties': {
            'name': place.name,
            'aliases': list(place.aliases),
            'kind': place.kind,
            'tags': list(place.tags),
        },
    }


def save_barriers(folder: Path, map_id: int, names: Sequence[str]) -> None:
    """Write a map of samples_1000.json with its barriers as objects, horizontal ones first."""
    barriers = find_barrier_map(load_barrier_maps(MAPS / 'samples_1000.json'), map_id)
    grid_map = barriers.to_grid()
    flat = [(b.first, b.line, b.last + 1, b.line + 1) for b in barriers.horizontal_barriers]
    upright = [(b.line, b.first, b.line + 1, b.last + 1) for b in barriers.vertical_barriers]
    places = [
        Place(name, box(*area), 'object', tuple(aliases))
        for (name, *aliases), area in zip((text.split(',') for text in names), flat + upright)
    ]
    save(folder, f'barriers_{map_id}', grid_map, places)


def warehouse() -> Drawing:
    """Draw three racks with two aisles, docks, a cold store and an office."""
    made = Drawing('warehouse', 40, 24)
    made.fill([(0, 17, 8.2, 17.2), (8, 17, 8.2, 24), (32, 17, 40, 17.2), (32, 17, 32.2, 24)])
    made.doors([(3.4, 17, 5, 17.2), (8, 20, 8.2, 21.6), (32, 19.6, 32.2, 21.2)])
    made.place('cold store', (0, 17, 8.1, 24), 'room', 'freezer,Kühllager,chambre froide')
    made.place('office', (32.1, 17, 40, 24), 'room', 'Büro,bureau,oficina')
    made.object('rack 1', (10, 5, 28, 6.4), 'first rack', 'rack')
    made.object('rack 2', (10, 9.4, 28, 10.8), 'second rack', 'rack')
    made.doors([(18, 9.4, 20, 10.8)])
    made.object('rack 3', (10, 13.8, 28, 15.2), 'third rack', 'rack')
    made.place('gap in rack 2', (18, 9.4, 20, 10.8), 'gap', 'gap')
    made.place('aisle 1', (10, 6.4, 28, 9.4), 'aisle', 'first aisle,Gang 1,allée 1,pasillo 1')
    made.place('aisle 2', (10, 10.8, 28, 13.8), 'aisle', 'second aisle,Gang 2,allée 2,pasillo 2')
    made.place('south lane', (10, 0, 28, 5), 'lane', 'southern lane')
    made.place('north lane', (10, 15.2, 28, 24), 'lane', 'northern lane')
    made.place(
        'receiving dock',
        (0, 1, 4, 6),
        'dock',
        'goods in,inbound dock,Wareneingang,muelle de entrada',
    )
    made.place(
        'shipping dock',
        (36, 1, 40, 6),
        'dock',
        'goods out,outbound dock,Warenausgang,muelle de salida',
    )
    made.place('charging bay', (32, 11, 35, 14), 'area', 'charger,charging station,Ladestation')
    made.object('conveyor', (30, 8, 36, 8.8), 'conveyor belt,belt,Förderband')
    made.object('baler', (13, 19, 15, 21), 'baling press')
    made.object('inspection table', (22, 19.6, 25, 20.6), 'table')
    return made


def house() -> Drawing:
    """Draw a flat of coloured rooms on both sides of a hall, with doors between neighbours."""
    made = Drawing('house', 16, 12, 0.1)
    made.fill([(0, 5.1, 16, 5.2), (0, 6.8, 16, 6.9)])
    made.fill([(x, 6.8, x + 0.1, 12) for x in (5, 8, 12)])
    made.fill([(x, 0, x + 0.1, 5.2) for x in (5, 9, 11.5)])
    made.doors([(x, 6.8, x + 1, 6.9) for x in (2, 6, 9.5, 13.5)])
    made.doors([(x, 5.1, x + 1, 5.2) for x in (2, 6.5, 9.8, 13)])
    made.doors([(x, 9, x + 0.1, 10) for x in (5, 8, 12)])
    made.doors([(x, 2, x + 0.1, 3) for x in (5, 9, 11.5)])
    made.place('hall', (0, 5.15, 16, 6.85), 'hall', 'hallway,corridor,Flur,couloir,pasillo')
    made.place('blue bedroom', (0, 6.85, 5.05, 12), 'bedroom', 'blaues Schlafzimmer', 'blue')
    made.place('green bathroom', (5.05, 6.85, 8.05, 12), 'bathroom', '', 'green')
    made.place('green bedroom', (8.05, 6.85, 12.05, 12), 'bedroom', 'chambre verte', 'green')
    made.place('study', (12.05, 6.85, 16, 12), 'room', 'home office,Arbeitszimmer,estudio', 'blue')
    made.place('kitchen', (0, 0, 5.05, 5.15), 'room', 'Küche,cuisine,cocina', 'yellow')
    made.place('dining room', (5.05, 0, 9.05, 5.15), 'room', 'Esszimmer,salle à manger,comedor')
    made.place('blue bathroom', (9.05, 0, 11.55, 5.15), 'bathroom', '', 'blue')
    made.place('living room', (11.55, 0, 16, 5.15), 'room', 'lounge,Wohnzimmer,salon,sala')
    made.object('dining table', (6.3, 1.2, 7.7, 3.8), 'table,Esstisch')
    made.object('sofa', (14.2, 1, 15.2, 3.4), 'couch')
    return made


def ward() -> Drawing:
    """Draw a hospital ward: two corridors, a block between them, rooms on both sides."""
    made = Drawing('ward', 36, 20)
    made.fill([(0, y, 36, y + 0.2) for y in (5, 15)])
    made.fill([(2.4, y, 33.6, y + 0.2) for y in (7.4, 12.4)])
    made.fill([(x, 7.4, x + 0.2, 12.6) for x in (2.4, 10, 17, 19.4, 28, 33.4)])
    made.doors([(17.2, y, 19.4, y + 0.2) for y in (7.4, 12.4)])
    for room in range(6):
        x = 6.0 * room
        made.fill([(x, 0, x + 0.2, 5), (x, 15, x + 0.2, 20)])
        made.doors([(x + 2.4, 5, x + 3.8, 5.2), (x + 2.4, 15, x + 3.8, 15.2)])
        tags = 'isolation' if room in (2, 3) else ''
        number = f'room {101 + room}', f'room {107 + room}'
        made.place(number[0], (x, 0, x + 6, 5.1), 'patient room', f'{101 + room}', tags)
        made.place(number[1], (x, 15.1, x + 6, 20), 'patient room', f'{107 + room}', '')
    made.doors([(x, y, x + 1.4, y + 0.2) for x in (6, 13, 23, 30) for y in (7.4, 12.4)])
    made.place("nurses' station", (2.5, 7.5, 10.1, 12.5), 'room', 'nurses station,nursing station')
    made.place('pharmacy', (10.1, 7.5, 17.1, 12.5), 'room', 'Apotheke,pharmacie,farmacia')
    made.place('passage', (17.1, 7.5, 19.5, 12.5), 'corridor', 'central passage,Durchgang')
    made.place(
        'operating theatre', (19.5, 7.5, 28.1, 12.5), 'room', 'theatre,OR,OP-Saal,quirófano'
    )
    made.place('sterile store', (28.1, 7.5, 33.5, 12.5), 'room', 'sterile storage')
    made.place('south corridor', (0, 5.1, 36, 7.5), 'corridor', 'Südflur,couloir sud,pasillo sur')
    made.place(
        'north corridor', (0, 12.5, 36, 15.1), 'corridor', 'Nordflur,couloir nord,pasillo norte'
    )
    made.place('west link', (0, 7.5, 2.5, 12.5), 'corridor')
    made.place('east link', (33.5, 7.5, 36, 12.5), 'corridor')
    return made


def office() -> Drawing:
    """Draw an office floor around an open space, with rooms that share a part of their names."""
    made = Drawing('office', 30, 18, 0.15)
    made.fill([(7.5, 0, 7.65, 18), (22.5, 0, 22.65, 18), (7.5, 12, 22.65, 12.15)])
    made.fill([(0, y, 7.65, y + 0.15) for y in (6, 12)])
    made.fill([(22.5, y, 30, y + 0.15) for y in (6, 12)])
    made.fill([(x, 12, x + 0.15, 18) for x in (12.6, 17.4)])
    made.doors([(x, y, x + 0.15, y + 1.5) for x in (7.5, 22.5) for y in (2.4, 8.4, 14.4)])
    made.doors([(x, 12, x + 1.5, 12.15) for x in (9.3, 14.25, 19.2)])
    made.doors([(x, y, x + 1.5, y + 0.15) for x in (3, 25.5) for y in (6, 12)])
    made.doors([(x, 14.4, x + 0.15, 15.9) for x in (12.6, 17.4)])
    meeting = 'meeting room'
    made.place(
        'meeting room north',
        (0, 12.1, 7.6, 18),
        meeting,
        'northern meeting room,salle de réunion nord',
    )
    made.place(
        'meeting room south',
        (0, 0, 7.6, 6.1),
        meeting,
        'southern meeting room,salle de réunion sud',
    )
    made.place('reception', (0, 6.1, 7.6, 12.1), 'room', 'front desk,Empfang,recepción')
    made.place('printer room', (7.6, 12.1, 12.7, 18), 'room', 'copy room,Kopierraum')
    made.place(
        'server room',
        (12.7, 12.1, 17.5, 18),
        'room',
        'data room,Serverraum,salle des serveurs,sala de servidores',
    )
    made.place('coffee corner', (17.5, 12.1, 22.6, 18), 'room', 'coffee bar,Kaffeeecke')
    made.place("director's office", (22.6, 12.1, 30, 18), 'office', 'directors office,boss office')
    made.place('accounts office', (22.6, 6.1, 30, 12.1), 'office', 'accounts,accounting')
    made.place('post room', (22.6, 0, 30, 6.1), 'room', 'mail room,Poststelle')
    made.place(
        'open space', (7.6, 0, 22.6, 12.1), 'area', 'open-plan area,bullpen,espacio abierto'
    )
    made.object('left desk block', (10.5, 3, 12.9, 9), 'west desks', 'desks')
    made.object('right desk block', (17.1, 3, 19.5, 9), 'east desks', 'desks')
    made.place('water cooler', (14.4, 0.6, 15.6, 1.8), 'area', 'cooler,dispenser')
    return made


def workshop() -> Drawing:
    """Draw a machine shop: machines as objects on an open floor, a paint booth and a tool crib."""
    made = Drawing('workshop', 28, 18)
    made.fill([(21, 12, 21.2, 18), (21, 12, 28, 12.2), (6, 0, 6.2, 4.2), (0, 4, 6.2, 4.2)])
    made.doors([(21, 14, 21.2, 15.6), (25, 12, 26.6, 12.2), (6, 1.4, 6.2, 3)])
    made.place('paint booth', (21.1, 12, 28, 18), 'room', 'spray booth,Lackierkabine')
    made.place('tool crib', (0, 0, 6.1, 4.1), 'room', 'tool store,Werkzeuglager')
    made.object('lathe', (5, 8, 8, 9.4), 'turning machine,Drehbank,tour', 'machine')
    made.object('milling machine', (11, 7, 13.4, 10), 'mill,Fräsmaschine,fresadora', 'machine')
    made.object('press', (16.4, 5, 18.4, 8.4), 'hydraulic press,Presse,prensa', 'machine')
    made.object('saw', (10, 13.6, 13, 14.6), 'band saw,Säge,scie,sierra', 'machine')
    made.object('robot cell', (21, 4, 25, 8), 'cell,Roboterzelle,celda del robot', 'machine')
    made.object('scrap bin', (15, 1.4, 16, 2.4), 'bin')
    made.place('welding area', (14.6, 11, 20, 17.6), 'area', 'welding zone,weld shop')
    made.place('assembly area', (1, 11, 7, 17), 'area', 'assembly,Montage,montaje')
    made.place('gate', (26.8, 0.6, 28, 2.6), 'gate', 'Tor,portón')
    made.place('first aid point', (9, 0.4, 11, 2.4), 'area', 'first aid')
    return made


def yard() -> Drawing:
    """Draw a yard turned in the map frame: containers, a pond, a fuel station, gates."""
    made = Drawing('yard', 40, 28, 0.25, Pose2D(6.0, -4.0, 0.4))
    made.object('red container', (8, 6, 14, 8.5), 'red box', 'container,red')
    made.object('blue container', (8, 12, 14, 14.5), 'blue box', 'container,blue')
    made.object('grey container', (8, 18, 14, 20.5), 'gray container', 'container')
    made.object('pond', (20, 9, 27, 16), 'Teich,étang,estanque')
    made.object('silo', (30, 20, 33, 23), '', '')
    made.fill([(34, 8, 40, 8.25), (34, 8, 34.25, 14), (34, 14, 40, 14.25)])
    made.doors([(34, 10, 34.25, 12)])
    made.place('garage', (34, 8, 40, 14.25), 'room', 'Garage,cochera')
    made.place('fuel station', (18, 21, 23, 26), 'area', 'pump,petrol station,Tankstelle')
    made.place('wash bay', (18, 1, 23, 5), 'area', 'car wash,Waschplatz')
    made.place('main gate', (0.5, 12, 2.5, 16), 'gate', 'Haupttor')
    made.place('back gate', (37, 22, 39.5, 26), 'gate', 'rear gate,Hintertor')
    made.places.append(Place('hydrant', Point(17, 17), 'point'))
    return made


def market() -> Drawing:
    """Draw a supermarket: six upright shelves with five aisles between them."""
    made = Drawing('market', 26, 20)
    for shelf in range(6):
        x = 4.0 + 3.4 * shelf
        made.object(f'shelf {shelf + 1}', (x, 5, x + 1, 15), '', 'shelf')
        if shelf < 5:
            words = ('one', 'two', 'three', 'four', 'five')[shelf]
            area = (x + 1, 5, x + 3.4, 15)
            made.place(
                f'aisle {shelf + 1}',
                area,
                'aisle',
                f'aisle {words},Gang {shelf + 1},allée {shelf + 1}',
            )
    made.place('bakery', (0, 16.6, 6, 20), 'area', 'bread counter,Bäckerei,boulangerie,panadería')
    made.place('dairy section', (10, 16.6, 16, 20), 'area', 'dairy,milk')
    made.place(
        'butcher', (20, 16.6, 26, 20), 'area', 'meat counter,Metzgerei,boucherie,carnicería'
    )
    made.place('entrance', (0, 0, 4, 3), 'area', 'entry,Eingang,entrée,entrada')
    made.place('checkout', (9, 0.2, 18, 3), 'area', 'tills,Kasse,caisse,caja')
    made.place('exit', (22, 0, 26, 3), 'area', 'Ausgang,sortie,salida')
    made.object('freezer', (7.4, 3.4, 10, 4.2), 'ice cream freezer')
    return made


def museum() -> Drawing:
    """Draw three by three rooms with a door between all neighbours but two pairs."""
    made = Drawing('museum', 24, 24)
    made.fill([(at, 0, at + 0.2, 24) for at in (8, 16)])
    made.fill([(0, at, 24, at + 0.2) for at in (8, 16)])
    middles = (3.4, 11.4, 19.4)
    made.doors([(x, y, x + 0.2, y + 1.6) for x in (8, 16) for y in middles])
    made.doors([(x, y, x + 1.6, y + 0.2) for y in (8, 16) for x in middles])
    # No door from the foyer to the map room, nor from the armoury to the Roman room.
    made.fill([(8, 3.4, 8.2, 5), (16, 11.4, 16.2, 13)])
    for x, y, name, aliases, tags in (
        (0, 0, 'foyer', 'entrance hall,lobby', ''),
        (8, 0, 'map room', 'Kartenzimmer', 'red'),
        (16, 0, 'mineral room', 'minerals,Mineralien', 'red'),
        (0, 8, 'Greek room', 'Greeks,salle grecque', 'antiquity'),
        (8, 8, 'armoury', 'armory,Rüstkammer,armería', ''),
        (16, 8, 'Roman room', 'Romans,salle romaine', 'antiquity'),
        (0, 16, 'Egyptian room', 'Egypt,Egyptians,sala egipcia', 'antiquity'),
        (8, 16, 'dinosaur hall', 'dinosaurs,Saurier,dinosaures,dinosaurios', ''),
        (16, 16, 'porcelain room', 'porcelain,china room,salle de porcelaine', 'red'),
    ):
        made.place(name, (x, y, x + 8.1, y + 8.1), 'room', aliases, tags)
    made.object('mummy', (3, 19, 5, 21), 'sarcophagus')
    made.object('skeleton', (10.6, 18.6, 13.4, 21.4), 'T. rex')
    made.place('door to the armoury', (3.4 + 4.5, 11.4, 8.3, 13), 'door', 'Greek door')
    return made


def make_maps(folder: Path) -> None:
    """Write all maps into a folder."""
    for draw in (warehouse, house, ward, office, workshop, yard, market, museum):
        draw().save(folder)
    for map_id, names in BARRIERS.items():
        save_barriers(folder, map_id, names)


if __name__ == '__main__':
    make_maps(FOLDER)
