// The WebSocket to the session: whole moments in, settings and requests out.

const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 5000;
const SEND_EVERY_MS = 33;

export class Connection {
  #socket = null;
  #wait = FIRST_WAIT_MS;
  #changes = {};
  #timer = null;

  // The next moment is asked for when onMoment(header, images) has returned.
  constructor(onMoment, onLost) {
    this.onMoment = onMoment;
    this.onLost = onLost;
    this.#open();
  }

  // Settings are sent together, at most thirty times a second, the newest value of each.
  set(changes) {
    Object.assign(this.#changes, changes);
    this.#timer ??= setTimeout(() => this.#flush(), SEND_EVERY_MS);
  }

  ask(request) {
    this.#flush();
    this.#send({ ask: request });
  }

  #flush() {
    clearTimeout(this.#timer);
    this.#timer = null;
    if (Object.keys(this.#changes).length === 0) return;
    this.#send({ set: this.#changes });
    this.#changes = {};
  }

  #send(message) {
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify(message));
  }

  async #show(parsed) {
    const { header, images } = await parsed;
    this.onMoment(header, images);
    for (const image of Object.values(images)) image.close();
    this.#send({ shown: header.number });
  }

  #open() {
    const socket = new WebSocket(`ws://${location.host}/view`);
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    let shown = Promise.resolve();
    socket.onmessage = ({ data }) => {
      this.#wait = FIRST_WAIT_MS;
      const parsed = parse(data); // beside the one before, whose turn comes first
      shown = shown.finally(() => this.#show(parsed));
    };
    socket.onclose = ({ code, reason }) => {
      this.onLost(code, reason);
      setTimeout(() => this.#open(), this.#wait);
      this.#wait = Math.min(2 * this.#wait, LONGEST_WAIT_MS);
    };
  }
}

async function parse(data) {
  const length = new DataView(data).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  let offset = 4 + length;
  const images = {};
  await Promise.all(Object.entries(header.parts).map(async ([name, bytes]) => {
    const jpeg = new Blob([new Uint8Array(data, offset, bytes)], { type: "image/jpeg" });
    offset += bytes;
    images[name] = await createImageBitmap(jpeg);
  }));
  return { header, images };
}
