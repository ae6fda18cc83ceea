// Which part of the map the panels show; all panels share it.

const MAX_ZOOM = 40;

export class Viewport {
  constructor() {
    this.reset();
  }

  reset() {
    this.zoom = 1;
    this.centre = null;
  }

  /** Zoom by a factor around a point in cells. */
  zoomBy(factor, map, around = this.centre ?? middle(map)) {
    const zoom = Math.min(MAX_ZOOM, Math.max(1, this.zoom * factor));
    const centre = this.centre ?? middle(map);
    const part = this.zoom / zoom;
    this.zoom = zoom;
    this.centre = [0, 1].map((axis) => around[axis] + part * (centre[axis] - around[axis]));
    this.clamp(map);
  }

  /** Move by cells. */
  pan(dx, dy, map) {
    const centre = this.centre ?? middle(map);
    this.centre = [centre[0] + dx, centre[1] + dy];
    this.clamp(map);
  }

  clamp(map) {
    const sizes = [map.width, map.height];
    this.centre = this.centre.map((value, axis) => {
      const half = sizes[axis] / (2 * this.zoom);
      return Math.min(sizes[axis] - half, Math.max(half, value + 0.5)) - 0.5;
    });
    if (this.zoom === 1) this.centre = null;
  }

  /** Return the functions between cells and pixels for a box {left, top, width, height}. */
  fit(map, box) {
    const scale = this.zoom * Math.min(box.width / map.width, box.height / map.height);
    const [cx, cy] = this.centre ?? middle(map);
    const x0 = box.left + box.width / 2;
    const y0 = box.top + box.height / 2;
    return {
      scale,
      toPixel: ([x, y]) => [x0 + scale * (x - cx), y0 - scale * (y - cy)],
      toCell: ([px, py]) => [cx + (px - x0) / scale, cy - (py - y0) / scale],
    };
  }
}

function middle(map) {
  return [map.width / 2 - 0.5, map.height / 2 - 0.5];
}
