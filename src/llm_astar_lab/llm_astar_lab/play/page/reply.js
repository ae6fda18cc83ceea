// What a model could have answered, as an example to change.

const MOST = 4;

/** Return a reply with up to four corners of a path, in the coordinates of the map. */
export function suggestedReply(path, map) {
  const turns = (i) =>
    [0, 1].some((axis) => path[i][axis] - path[i - 1][axis] !== path[i + 1][axis] - path[i][axis]);
  const corners = path.filter((_, i) => i > 0 && i < path.length - 1 && turns(i));
  const step = Math.max(1, Math.ceil(corners.length / MOST));
  const cells = corners
    .filter((_, i) => i % step === 0)
    .map(
      (cell) => `[${cell.map((value, axis) => Math.round(value + map.offset[axis])).join(', ')}]`,
    );
  return `Generated Path: [${cells.join(', ')}]`;
}
