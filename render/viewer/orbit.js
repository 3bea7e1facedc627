// The viewpoint of the rendered picture: dragged, scrolled or by keys.

const RAD_PER_PX = 0.008;
const KEY_STEP_RAD = Math.PI / 36;
const LOWEST_RAD = -0.2;
const HIGHEST_RAD = 1.5;

export const HOME = { azimuth_rad: -Math.PI + Math.PI / 9, elevation_rad: Math.PI / 15, distance: 1 };

export class Orbit {
  #view = { ...HOME };
  #drag = null;
  #touchedAt = -Infinity;

  constructor(canvas, send) {
    this.send = send;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.#drag = { x: event.clientX, y: event.clientY };
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.#drag) return;
      const [dx, dy] = [event.clientX - this.#drag.x, event.clientY - this.#drag.y];
      this.#drag = { x: event.clientX, y: event.clientY };
      this.#turn(-RAD_PER_PX * dx, RAD_PER_PX * dy);
    });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { this.#drag = null; });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.#approach(Math.exp(0.001 * event.deltaY));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const act = {
        ArrowLeft: () => this.#turn(-KEY_STEP_RAD, 0),
        ArrowRight: () => this.#turn(KEY_STEP_RAD, 0),
        ArrowUp: () => this.#turn(0, KEY_STEP_RAD),
        ArrowDown: () => this.#turn(0, -KEY_STEP_RAD),
        "+": () => this.#approach(0.9),
        "-": () => this.#approach(1 / 0.9),
        Home: () => this.reset(),
      }[event.key];
      if (!act) return;
      event.preventDefault();
      act();
    });
  }

  // What the session has, unless it is being changed here.
  follow(settings) {
    if (performance.now() - this.#touchedAt < 1000) return;
    for (const name of Object.keys(HOME)) this.#view[name] = settings[name];
  }

  reset() {
    this.#apply({ ...HOME });
  }

  #turn(azimuth, elevation) {
    const turned = this.#view.azimuth_rad + azimuth;
    this.#apply({
      ...this.#view,
      azimuth_rad: turned - 2 * Math.PI * Math.round(turned / (2 * Math.PI)),
      elevation_rad: Math.min(Math.max(this.#view.elevation_rad + elevation, LOWEST_RAD), HIGHEST_RAD),
    });
  }

  #approach(factor) {
    this.#apply({ ...this.#view, distance: Math.min(Math.max(this.#view.distance * factor, 0.3), 4) });
  }

  #apply(view) {
    this.#view = view;
    this.#touchedAt = performance.now();
    this.send(view);
  }
}
