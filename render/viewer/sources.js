// The sources of a blend: how much each counts, and what is the matter with it.

const SEEING = new Set(["running", "clipped", "dark"]);

export class Sources {
  #items = [];

  constructor(fieldset, list) {
    this.fieldset = fieldset;
    this.list = list;
  }

  // `states` says in words what each state is.
  show(sources = [], states) {
    this.fieldset.hidden = sources.length === 0;
    while (this.#items.length < sources.length) this.#items.push(this.#add());
    sources.forEach(({ name, place_m: place, weight, state, age_s: age }, index) => {
      const item = this.#items[index];
      const isSeeing = SEEING.has(state);
      item.root.classList.toggle("away", !isSeeing);
      item.name.textContent = name;
      item.share.textContent = `${Math.round(100 * weight)} %`;
      item.meter.value = weight;
      item.meter.setAttribute("aria-label", `Share of ${name}`);
      const old = isSeeing || age === null ? "" : `, ${age.toFixed(1)} s old`;
      const told = `${states[state] ?? state}${old}`;
      item.note.textContent = `${told} · at ${place.join(", ")} m`;
    });
  }

  #add() {
    const root = document.createElement("li");
    const [name, share, note] = ["b", "span", "small"].map((tag) => document.createElement(tag));
    const meter = document.createElement("meter");
    root.append(name, share, meter, note);
    this.list.append(root);
    return { root, name, share, meter, note };
  }
}
