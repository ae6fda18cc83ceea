"""The committed maps of the instruction suite are those that the script draws."""

from benchmarks.make_instruction_maps import FOLDER, make_maps

MAP_FILES = ('.pgm', '.yaml', '.geojson')


def test_the_committed_maps_are_those_of_the_script(tmp_path):
    make_maps(tmp_path)
    drawn = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    kept = {p.name: p.read_bytes() for p in FOLDER.iterdir() if p.suffix in MAP_FILES}
    assert drawn == kept
    assert len(drawn) == 3 * 11
