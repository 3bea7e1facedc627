// The lat-long map with its lights: a ring's area is a light's share, a thin line its extent.
// Directions are (x, y, z) with y up; the middle of the map is +z, and +x lies a quarter from the left.

const CELL = "#ffbe00";
const KEY = "#00dcff";
const EDGE_STEPS = 72;

export class LightMap {
  #image = null;
  #lights = null;
  #markers = [];
  #chosen = -1;

  constructor(canvas, tip) {
    this.canvas = canvas;
    this.tip = tip;
    new ResizeObserver(() => this.#draw()).observe(canvas);
    canvas.addEventListener("pointermove", (event) => this.#choose(this.#nearest(event)));
    canvas.addEventListener("pointerleave", () => this.#choose(-1));
    canvas.addEventListener("blur", () => this.#choose(-1));
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!step || this.#markers.length === 0) return;
      event.preventDefault();
      const count = this.#markers.length;
      this.#choose((this.#chosen + step + count) % count);
    });
  }

  show(image, lights) {
    if (image) {
      this.#image ??= document.createElement("canvas");
      this.#image.width = image.width;
      this.#image.height = image.height;
      this.#image.getContext("2d").drawImage(image, 0, 0);
    }
    this.#lights = lights;
    this.#draw();
  }

  #draw() {
    if (!this.#image) return;
    const { canvas } = this;
    const density = window.devicePixelRatio || 1;
    const width = Math.round(canvas.clientWidth * density);
    const height = Math.round(width / 2);
    if (width === 0) return;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const pen = canvas.getContext("2d");
    pen.imageSmoothingQuality = "high";
    pen.drawImage(this.#image, 0, 0, width, height);
    drawGrid(pen, width, height, density);
    this.#markers = this.#lights ? markersOf(this.#lights, width, height, density) : [];
    for (const marker of this.#markers) drawEdge(pen, marker, width, height, density);
    for (const marker of [...this.#markers].reverse()) drawRing(pen, marker, width, density, false);
    if (this.#markers[this.#chosen]) drawRing(pen, this.#markers[this.#chosen], width, density, true);
    this.#tell();
  }

  #nearest(event) {
    const box = this.canvas.getBoundingClientRect();
    const scale = this.canvas.width / box.width;
    const x = (event.clientX - box.left) * scale;
    const y = (event.clientY - box.top) * scale;
    let best = -1;
    let least = Infinity;
    this.#markers.forEach((marker, index) => {
      const distance = Math.hypot(marker.x - x, marker.y - y);
      if (distance < Math.max(marker.radius, 14 * scale) && distance < least) [best, least] = [index, distance];
    });
    return best;
  }

  #choose(index) {
    if (index === this.#chosen) return;
    this.#chosen = index;
    this.#draw();
  }

  #tell() {
    const marker = this.#markers[this.#chosen];
    this.tip.hidden = !marker;
    if (!marker) return;
    this.tip.textContent = describe(marker, this.#lights.scale);
    const scale = this.canvas.clientWidth / this.canvas.width;
    const right = this.canvas.clientWidth - this.tip.offsetWidth - 4;
    const below = marker.y * scale + 14;
    const isLow = below + this.tip.offsetHeight > this.canvas.clientHeight;
    const top = isLow ? marker.y * scale - 14 - this.tip.offsetHeight : below;
    const left = Math.max(4, Math.min(marker.x * scale + 12, right));
    this.tip.style.transform = `translate(${left}px, ${top}px)`;
  }
}

function toMap([x, y, z], width, height) {
  const u = 0.5 - Math.atan2(x, z) / (2 * Math.PI);
  const v = Math.acos(Math.max(-1, Math.min(1, y))) / Math.PI;
  return { x: u * width, y: v * height };
}

// Strongest first; lights without light are fading ones' places and are left out.
function markersOf(lights, width, height, density) {
  const powers = lights.irradiance.map((rgb) => rgb[0] + rgb[1] + rgb[2]);
  const total = powers.reduce((sum, power) => sum + power, 0);
  const markers = lights.directions.map((direction, index) => ({
    ...toMap(direction, width, height),
    direction,
    share: total > 0 ? powers[index] / total : 0,
    irradiance: lights.irradiance[index],
    radiusRad: lights.angular_radius_rad[index],
    isKey: lights.is_key[index],
  })).filter((marker) => marker.share > 0);
  for (const marker of markers) {
    const radius = 0.06 * width * Math.sqrt(marker.share);
    marker.radius = Math.min(Math.max(radius, 3 * density), 0.06 * width);
  }
  return markers.sort((a, b) => b.share - a.share);
}

function drawGrid(pen, width, height, density) {
  pen.strokeStyle = "#ffffff38";
  pen.lineWidth = density;
  pen.setLineDash([3 * density, 4 * density]);
  pen.beginPath();
  pen.moveTo(0, height / 2);
  pen.lineTo(width, height / 2);
  for (const u of [0.25, 0.5, 0.75]) {
    pen.moveTo(u * width, 0);
    pen.lineTo(u * width, height);
  }
  pen.stroke();
  pen.setLineDash([]);
  pen.font = `${11 * density}px system-ui, sans-serif`;
  pen.textBaseline = "bottom";
  for (const [name, u] of [["−Z", 0], ["+X", 0.25], ["+Z", 0.5], ["−X", 0.75]]) {
    pen.fillStyle = "#000a";
    pen.fillText(name, u * width + 5 * density, height - 3 * density);
    pen.fillStyle = "#fffd";
    pen.fillText(name, u * width + 4 * density, height - 4 * density);
  }
}

function drawRing(pen, marker, width, density, isChosen) {
  for (const turn of [-width, 0, width]) { // what crosses the seam goes on at the other edge
    pen.beginPath();
    pen.arc(marker.x + turn, marker.y, marker.radius, 0, 2 * Math.PI);
    pen.fillStyle = displayColour(marker.irradiance, isChosen ? 0.9 : 0.55);
    pen.fill();
    pen.lineWidth = (isChosen ? 5 : 3.4) * density;
    pen.strokeStyle = "#000c";
    pen.stroke();
    pen.lineWidth = (isChosen ? 3 : 1.7) * density;
    pen.strokeStyle = isChosen ? "#fff" : marker.isKey ? KEY : CELL;
    pen.stroke();
  }
}

function drawEdge(pen, marker, width, height, density) {
  if (marker.radiusRad < Math.PI / 180) return;
  const points = circle(marker.direction, marker.radiusRad).map((d) => toMap(d, width, height));
  for (let index = 1; index < points.length; index++) { // unwrapped, so that no line crosses the map
    const step = points[index].x - points[index - 1].x;
    points[index].x -= width * Math.round(step / width);
  }
  pen.lineWidth = density;
  pen.strokeStyle = marker.isKey ? `${KEY}b0` : `${CELL}70`;
  for (const turn of [-width, 0, width]) {
    pen.beginPath();
    for (const { x, y } of points) pen.lineTo(x + turn, y);
    pen.stroke();
  }
}

function circle(d, radius) {
  const helper = Math.abs(d[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0];
  const across = unit(cross(helper, d));
  const along = cross(d, across);
  return Array.from({ length: EDGE_STEPS + 1 }, (_, step) => {
    const angle = (2 * Math.PI * step) / EDGE_STEPS;
    const [c, s] = [Math.cos(angle) * Math.sin(radius), Math.sin(angle) * Math.sin(radius)];
    return d.map((value, axis) => Math.cos(radius) * value + c * across[axis] + s * along[axis]);
  });
}

function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

function unit(a) {
  const length = Math.hypot(...a);
  return a.map((value) => value / length);
}

// The light's hue at full brightness, sRGB-coded.
function displayColour(rgb, alpha) {
  const largest = Math.max(...rgb);
  const coded = rgb.map((value) => {
    const linear = value / largest;
    return Math.round(255 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055));
  });
  return `rgb(${coded.join(" ")} / ${alpha})`;
}

function describe(marker, scale) {
  const [x, y, z] = marker.direction;
  const degrees = (angle) => `${Math.round((180 / Math.PI) * angle)}°`;
  return [
    `${marker.isKey ? "Key light" : "Light"}, ${(100 * marker.share).toPrecision(2)} % of all lights`,
    `azimuth ${degrees(Math.atan2(x, z))}, elevation ${degrees(Math.asin(y))}, radius ${((180 / Math.PI) * marker.radiusRad).toFixed(1)}°`,
    `irradiance ${marker.irradiance.map((value) => value.toPrecision(3)).join("  ")} ${scale} × sr`,
  ].join("\n");
}
