// Prints what Foxglove and Lichtblick decode, with the npm packages that they use: a JSON line per message.
//
//   node foxglove_reader.mjs FOLDER file PATH            the messages of an MCAP file
//   node foxglove_reader.mjs FOLDER live URL SECONDS     those of a live connection, all topics
//
// FOLDER has node_modules with @mcap/core, @mcap/support, @foxglove/rosmsg, @foxglove/rosmsg2-serialization,
// @foxglove/ws-protocol and ws. Bytes are printed as {"base64": ...}.
import { createRequire } from "node:module";
import { readFileSync } from "node:fs";

const [folder, mode, address, seconds] = process.argv.slice(2);
const require = createRequire(`${folder}/package.json`);
const { McapIndexedReader, TempBuffer } = require("@mcap/core");
const { loadDecompressHandlers, protobufFromBinaryDescriptor } = require("@mcap/support");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const WebSocket = require("ws");

function decoderOf(messageEncoding, schema) {
  const text = () => new TextDecoder().decode(schema.data);
  if (messageEncoding === "cdr" && schema.encoding === "ros2msg") {
    const reader = new MessageReader(parse(text(), { ros2: true }));
    return (data) => reader.readMessage(data);
  }
  if (messageEncoding === "protobuf" && schema.encoding === "protobuf") {
    const type = protobufFromBinaryDescriptor(schema.data).lookupType(schema.name);
    return (data) => type.toObject(type.decode(data));
  }
  if (messageEncoding === "json" && schema.encoding === "jsonschema") {
    JSON.parse(text());
    return (data) => JSON.parse(new TextDecoder().decode(data));
  }
  throw new Error(`no decoder for ${messageEncoding} with ${schema.encoding}`);
}

function plain(value) {
  if (typeof value === "bigint") return Number(value);
  if (value instanceof Uint8Array) return { base64: Buffer.from(value).toString("base64") };
  if (ArrayBuffer.isView(value) || Array.isArray(value)) return Array.from(value, plain);
  if (value && typeof value === "object")
    return Object.fromEntries(Object.entries(value).map(([key, each]) => [key, plain(each)]));
  return Number.isNaN(value) ? "NaN" : value;
}

const print = (line) => console.log(JSON.stringify(line));

async function readFile() {
  const reader = await McapIndexedReader.Initialize({
    readable: new TempBuffer(readFileSync(address)),
    decompressHandlers: await loadDecompressHandlers(),
  });
  const decoders = new Map();
  for await (const message of reader.readMessages()) {
    const channel = reader.channelsById.get(message.channelId);
    if (!decoders.has(channel.id)) {
      decoders.set(channel.id, decoderOf(channel.messageEncoding, reader.schemasById.get(channel.schemaId)));
    }
    const value = decoders.get(channel.id)(message.data);
    print({ topic: channel.topic, time_ns: String(message.logTime), message: plain(value) });
  }
}

function listen() {
  const client = new FoxgloveClient({ ws: new WebSocket(address, ["foxglove.sdk.v1"]) });
  const subscribed = new Map();
  client.on("error", (error) => {
    console.error(String(error));
    process.exit(1);
  });
  client.on("advertise", (channels) => {
    for (const { id, topic, encoding, schemaName, schema, schemaEncoding } of channels) {
      const data = schemaEncoding === "jsonschema" ? Buffer.from(schema) : Buffer.from(schema, "base64");
      const decode = decoderOf(encoding, { name: schemaName, encoding: schemaEncoding, data });
      subscribed.set(client.subscribe(id), { topic, decode });
    }
  });
  client.on("message", ({ subscriptionId, timestamp, data }) => {
    const { topic, decode } = subscribed.get(subscriptionId);
    const bytes = new Uint8Array(data.buffer, data.byteOffset, data.byteLength);
    print({ topic, time_ns: String(timestamp), message: plain(decode(bytes)) });
  });
  setTimeout(() => process.exit(0), 1000 * Number(seconds));
}

if (mode === "file") await readFile();
else listen();
