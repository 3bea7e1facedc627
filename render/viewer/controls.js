// Controls show the session's settings, and change them: so they survive a reload, and are the same
// on every page that watches.

const HELD_MS = 700; // a value that was just changed here is not overwritten by an older one

export class Controls {
  #touched = new Map();
  #settings = null;

  constructor(form, send) {
    this.form = form;
    this.send = send;
    form.addEventListener("submit", (event) => event.preventDefault());
    for (const input of form.querySelectorAll("[data-setting]")) {
      input.addEventListener("input", () => this.#change(input));
    }
    for (const toggle of form.querySelectorAll("[data-enables]")) {
      toggle.addEventListener("input", () => {
        const input = form.querySelector(`[data-setting="${toggle.dataset.enables}"]`);
        this.#send(toggle.dataset.enables, toggle.checked ? Number(input.value || input.dataset.default) : null);
      });
    }
    for (const toggle of form.querySelectorAll("[data-clears]")) {
      toggle.addEventListener("input", () => {
        this.#send(toggle.dataset.clears, toggle.checked ? null : this.shownEv ?? 0);
      });
    }
    const exposures = form.querySelector("#exposures");
    exposures.addEventListener("change", () => this.#changeExposures(exposures));
  }

  follow(header) {
    this.#settings = header.settings;
    this.shownEv = header.view_ev;
    fillChoices(this.form.querySelector("#method"), header.methods);
    fillChoices(this.form.querySelector("#model"), header.models);
    fillChoices(this.form.querySelector("#material"), header.materials);
    for (const input of this.form.querySelectorAll("[data-setting]")) this.#show(input);
    for (const toggle of this.form.querySelectorAll("[data-enables]")) {
      toggle.checked = header.settings[toggle.dataset.enables] !== null;
    }
    for (const toggle of this.form.querySelectorAll("[data-clears]")) {
      toggle.checked = header.settings[toggle.dataset.clears] === null;
    }
    const isAdaptive = header.settings.method === "adaptive";
    const isAuto = header.settings.is_auto && isAdaptive;
    for (const radio of this.form.querySelectorAll('[name="is_auto"]')) {
      radio.disabled = !isAdaptive && radio.value === "true";
      if (!this.#isHeld("is_auto")) radio.checked = String(isAuto) === radio.value;
    }
    this.form.querySelector(".when-count").hidden = isAuto;
    this.form.querySelector(".when-error").hidden = !isAuto;
    this.#showExposures(header);
  }

  #change(input) {
    const name = input.dataset.setting;
    if (input.type === "number" && (input.value === "" || !input.validity.valid)) return;
    this.#send(name, valueOf(input));
    for (const other of this.form.querySelectorAll(`[data-setting="${name}"]`)) {
      if (other !== input) put(other, valueOf(input));
    }
  }

  #send(name, value) {
    this.#touched.set(name, performance.now());
    this.send({ [name]: value });
  }

  #isHeld(name) {
    return performance.now() - (this.#touched.get(name) ?? -Infinity) < HELD_MS;
  }

  #show(input) {
    const name = input.dataset.setting;
    if (input.type === "radio" || this.#isHeld(name)) return;
    if (document.activeElement === input && input.type === "number") return;
    const value = this.#settings[name];
    if (value === null) {
      if (name === "view_ev" && this.shownEv !== null) put(input, this.shownEv);
      else if ("default" in input.dataset) put(input, Number(input.dataset.default));
    } else {
      put(input, value);
    }
  }

  #showExposures({ settings, account }) {
    const input = this.form.querySelector("#exposures");
    const note = this.form.querySelector("#exposures-note");
    const isCamera = account.is_camera !== false;
    input.disabled = !isCamera;
    note.textContent = isCamera ? "Empty chooses them for the scene." : "A recording keeps the exposures it was made with.";
    if (document.activeElement === input) return;
    input.value = (settings.exposures_s ?? []).map((time) => time < 0.5 ? `1/${Math.round(1 / time)}` : `${time}`).join(", ");
  }

  #changeExposures(input) {
    const times = input.value.split(",").filter((part) => part.trim()).map(seconds);
    const isUsable = times.every((time) => time >= 1e-6 && time <= 100);
    input.setCustomValidity(isUsable ? "" : "Times in seconds, such as 1/1000, 1/60");
    if (isUsable) this.#send("exposures_s", times.length ? times : null);
    else input.reportValidity();
  }
}

function seconds(text) {
  const [numerator, denominator = "1"] = text.split("/");
  return Number(numerator) / Number(denominator);
}

function valueOf(input) {
  if (input.type === "checkbox") return input.checked;
  if (input.type === "radio") return input.value === "true";
  if (input.tagName === "SELECT") return input.value;
  const shown = input.dataset.curve === "square" && input.type === "range"
    ? Math.round(uncurved(Number(input.value), Number(input.max))) : Number(input.value);
  return shown / Number(input.dataset.scale ?? 1);
}

function put(input, value) {
  if (input.type === "checkbox") input.checked = value;
  else if (input.tagName === "SELECT") input.value = value;
  else {
    const shown = value * Number(input.dataset.scale ?? 1);
    const isCurved = input.dataset.curve === "square" && input.type === "range";
    input.value = isCurved ? curved(shown, Number(input.max)) : Number(shown.toFixed(3));
  }
}

// A slider on which small numbers have more room: its place is the root of the number.
function curved(value, max) {
  return Math.sqrt(value / max) * max;
}

function uncurved(place, max) {
  return Math.max((place / max) ** 2 * max, 1);
}

function fillChoices(select, names) {
  if (select.options.length === names.length) return;
  select.replaceChildren(...names.map((name) => new Option(name, name)));
}
