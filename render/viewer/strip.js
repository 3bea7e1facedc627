// Time of each stage over the last frames, and the numbers of the session.

const STAGES = [
  ["merge", "#4aa3ff"], ["remap", "#8d7bff"], ["blocks", "#d36bd6"], ["lights", "#ffbe2e"], ["render", "#35c48d"],
];
const KEPT = 240;

export class Strip {
  #frames = [];

  constructor(canvas, legend, counters) {
    this.canvas = canvas;
    this.counters = counters;
    this.values = {};
    for (const [name, colour] of STAGES) {
      const item = document.createElement("li");
      item.innerHTML = `<svg viewBox="0 0 9 9" aria-hidden="true"><rect width="9" height="9" rx="2" fill="${colour}"/></svg>${name} <b>–</b>`;
      this.values[name] = item.querySelector("b");
      legend.append(item);
    }
    new ResizeObserver(() => this.#draw()).observe(canvas);
  }

  show(header) {
    const { times_ms: times, counters } = header.account;
    if (times && header.state.name === "running") {
      this.#frames.push(times);
      if (this.#frames.length > KEPT) this.#frames.shift();
      for (const [name] of STAGES) this.values[name].textContent = name in times ? `${times[name].toFixed(1)} ms` : "–";
    }
    if (counters) this.#showNumbers(header, counters);
    this.#draw();
  }

  #showNumbers({ lights, view_ev: ev, account }, counters) {
    const percent = (share) => `${(100 * share).toPrecision(2)} %`;
    const numbers = [
      ["captured", counters.captured],
      ["replaced", counters.replaced],
      ["merged", counters.merged],
      ["rendered", counters.rendered],
      ["failed", counters.failed, counters.failed > 0 && "bad"],
    ];
    if (lights) {
      numbers.push(["predicted error", lights.predicted_error == null ? "–" : percent(lights.predicted_error)]);
      numbers.push(["clipped light", lights.clipped_fraction ? percent(lights.clipped_fraction) : "none", lights.clipped_fraction > 0 && "warn"]);
    }
    if (ev != null) numbers.push(["view exposure", `${ev > 0 ? "+" : ""}${ev.toFixed(1)} EV`]);
    if (account.reopened) numbers.push(["reopened", account.reopened, "warn"]);
    this.counters.replaceChildren(...numbers.map(([name, value, mark]) => {
      const cell = document.createElement("div");
      if (mark) cell.className = mark;
      const [term, number] = [document.createElement("dt"), document.createElement("dd")];
      [term.textContent, number.textContent] = [name, value];
      cell.append(term, number);
      return cell;
    }));
  }

  #draw() {
    const density = window.devicePixelRatio || 1;
    const width = Math.round(this.canvas.clientWidth * density);
    const height = Math.round(this.canvas.clientHeight * density);
    if (width === 0 || height === 0) return;
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
    const pen = this.canvas.getContext("2d");
    pen.clearRect(0, 0, width, height);
    const totals = this.#frames.map((frame) => STAGES.reduce((sum, [name]) => sum + (frame[name] ?? 0), 0));
    const top = ceiling(quantile(totals, 0.97));
    const bar = width / KEPT;
    this.#frames.forEach((frame, index) => {
      const x = width - (this.#frames.length - index) * bar;
      let y = height;
      for (const [name, colour] of STAGES) {
        const tall = ((frame[name] ?? 0) / top) * height;
        pen.fillStyle = colour;
        pen.fillRect(x, y - tall, Math.max(bar - density * 0.5, 1), tall);
        y -= tall;
      }
    });
    pen.fillStyle = getComputedStyle(this.canvas).color;
    pen.font = `${11 * density}px system-ui, sans-serif`;
    pen.textBaseline = "top";
    pen.globalAlpha = 0.75;
    pen.fillText(`${top} ms`, 6 * density, 5 * density);
    pen.globalAlpha = 1;
  }
}

function quantile(values, share) {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted.length ? sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] : 10;
}

// A round number above: 1, 2 or 5 times a power of ten.
function ceiling(value) {
  const power = 10 ** Math.floor(Math.log10(Math.max(value, 1)));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= value);
}
