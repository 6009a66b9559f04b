// The websocket: receives updates and messages, sends requests, and reconnects when it is closed.

const TYPES = { f4: Float32Array, u1: Uint8Array, jpeg: Uint8Array };
const RETRY_MS = [500, 1000, 2000, 4000];

/** Head and parts of a binary message; the parts are views of it. */
export function unpack(buffer) {
  const size = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, size)));
  const parts = {};
  for (const part of head.parts) {
    const Type = TYPES[part.type];
    parts[part.name] = new Type(buffer, 4 + size + part.at, part.size / Type.BYTES_PER_ELEMENT);
  }
  return { head, parts };
}

export class Connection {
  /** `onMessage` gets text messages, `onUpdate` gets updates, `onState` gets true or false, and a reason. */
  constructor({ onMessage, onUpdate, onState }) {
    Object.assign(this, { onMessage, onUpdate, onState, tries: 0, ended: false });
    this.open();
  }

  open() {
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/stream`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => { this.tries = 0; this.ended = false; this.onState(true); };
    socket.onmessage = ({ data }) => {
      if (typeof data === "string") {
        const message = JSON.parse(data);
        if (message.kind === "end") this.ended = true;
        this.onMessage(message);
      } else {
        const update = unpack(data);
        this.send({ type: "ack", number: update.head.number });
        this.onUpdate(update);
      }
    };
    socket.onclose = ({ reason }) => {
      this.onState(false, reason);
      setTimeout(() => this.open(), RETRY_MS[Math.min(this.tries++, RETRY_MS.length - 1)]);
    };
    this.socket = socket;
  }

  send(message) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }
}
