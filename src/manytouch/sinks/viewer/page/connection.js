// The websocket: updates as they come, the newest alone; wishes as they are made. Comes back by itself.

const TYPES = { f4: Float32Array, u1: Uint8Array, jpeg: Uint8Array };
const AGAIN_MS = [500, 1000, 2000, 4000];

/** Head and parts of a binary message; the parts look into it without copies. */
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
  /** `hear` gets sentences by kind, `see` gets updates, `state` gets true or false. */
  constructor({ hear, see, state }) {
    Object.assign(this, { hear, see, state, tries: 0, ended: false });
    this.open();
  }

  open() {
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/stream`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => { this.tries = 0; this.ended = false; this.state(true); };
    socket.onmessage = ({ data }) => {
      if (typeof data === "string") {
        const sentence = JSON.parse(data);
        if (sentence.kind === "end") this.ended = true;
        this.hear(sentence);
      } else {
        const update = unpack(data);
        this.wish({ wish: "taken", number: update.head.number });
        this.see(update);
      }
    };
    socket.onclose = () => {
      this.state(false);
      setTimeout(() => this.open(), AGAIN_MS[Math.min(this.tries++, AGAIN_MS.length - 1)]);
    };
    this.socket = socket;
  }

  wish(wish) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(wish));
  }
}
