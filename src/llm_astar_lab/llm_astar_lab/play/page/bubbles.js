// What floats over the map: what can be asked of a place, and the name of a new one.

const $ = (id) => document.getElementById(id);

export class Bubbles {
  /** `onClause(verb, name)` is called for a place, `onNamed(polygon, name)` for a new one. */
  constructor(stage, onClause, onNamed) {
    this.stage = stage;
    this.polygon = null;
    $('room').addEventListener('click', ({ target }) => {
      if (!target.dataset.verb) return;
      this.close();
      onClause(target.dataset.verb, $('room-name').textContent);
    });
    $('naming').addEventListener('submit', (event) => {
      event.preventDefault();
      const [polygon, name] = [this.polygon, $('place-name').value.trim()];
      this.close();
      if (polygon && name) onNamed(polygon, name);
    });
    $('unnamed').addEventListener('click', () => this.close());
  }

  showRoom(name, point) {
    this.close();
    $('room-name').textContent = name;
    this.putNear($('room'), point);
  }

  /** Ask for the name of an area; `name` is a suggestion. */
  askName(polygon, name) {
    this.close();
    this.polygon = polygon;
    this.stage.showDraft(polygon);
    this.putNear($('naming'), polygon[0]);
    $('place-name').value = name;
    $('place-name').select();
  }

  close() {
    $('room').hidden = true;
    if (this.polygon) this.stage.showDraft([]);
    this.polygon = null;
    $('naming').hidden = true;
  }

  /** Show a bubble below a point of the map, within its width. */
  putNear(bubble, point) {
    bubble.hidden = false;
    const { main } = this.stage;
    const [x, y] = main.view.toPixel(point);
    const half = bubble.offsetWidth / 2;
    const room = main.canvas.clientWidth - half;
    bubble.style.left = `${Math.max(half, Math.min(room, x))}px`;
    bubble.style.top = `${Math.min(y, main.canvas.clientHeight - 60)}px`;
  }
}
