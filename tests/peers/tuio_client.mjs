// Prints what the npm packages tuio-client and osc receive: node tuio_client.mjs FOLDER VERSION PORT SECONDS
// FOLDER has node_modules with both packages; VERSION is 1 or 2.
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";

const [folder, version, port, seconds] = process.argv.slice(2);
const require = createRequire(`${folder}/package.json`);
const osc = require("osc");
const tuio = await import(pathToFileURL(`${folder}/node_modules/tuio-client/dist/tuio-client.es.js`));

class Receiver extends tuio.TuioReceiver {
  connect() { this.isConnected = true; }
  disconnect() { this.isConnected = false; }
}

const print = (event, id, ...numbers) => console.log(JSON.stringify({ event, id, numbers }));
const pointer = (event) => (each) => {
  const { position, press } = each.pointer;
  print(event, each.sessionId, position.x, position.y, press, each.bounds.size.x, each.bounds.size.y);
};
const cursor = (event) => (each) => print(event, each.sessionId, each.position.x, each.position.y);
const ignore = () => {};
const receiver = new Receiver();
const client = version === "2" ? new tuio.Tuio20Client(receiver) : new tuio.Tuio11Client(receiver);
client.addTuioListener({
  tuioAdd: pointer("add"), tuioUpdate: pointer("update"), tuioRemove: pointer("remove"), tuioRefresh: ignore,
  addTuioCursor: cursor("add"), updateTuioCursor: cursor("update"), removeTuioCursor: cursor("remove"),
  addTuioObject: ignore, updateTuioObject: ignore, removeTuioObject: ignore,
  addTuioBlob: ignore, updateTuioBlob: ignore, removeTuioBlob: ignore, refresh: ignore,
});
client.connect();

const socket = new osc.UDPPort({ localAddress: "127.0.0.1", localPort: Number(port), metadata: false });
// The client expects a time tag as one number of 64 bits.
const plain = (value) => (value?.raw ? (BigInt(value.raw[0]) << 32n) + BigInt(value.raw[1]) : value);
socket.on("message", ({ address, args }) => receiver.onOscMessage({ address, args: args.map(plain) }));
socket.on("ready", () => console.log(JSON.stringify({ event: "ready" })));
socket.open();
setTimeout(() => process.exit(0), 1000 * Number(seconds));
