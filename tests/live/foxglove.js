// A client of the Foxglove WebSocket protocol, as its makers implement it: `node foxglove.js URL SUBPROTOCOL COUNT`.
// Subscribes to every channel, waits for COUNT messages and one of each topic named after it, and prints all it
// received as one JSON document.

const { FoxgloveClient } = require("@foxglove/ws-protocol");
const WebSocket = require("ws");

const [url, subprotocol, count, ...topics] = process.argv.slice(2);
const socket = new WebSocket(url, [subprotocol]);
const client = new FoxgloveClient({ ws: socket });
const received = { serverInfo: null, channels: [], messages: [], errors: [] };
const subscribed = new Map();
const seen = new Set();

client.on("error", (error) => received.errors.push(String(error)));
client.on("status", (status) => received.errors.push(status.message));
client.on("serverInfo", (info) => { received.serverInfo = info; });
client.on("advertise", (channels) => {
  for (const channel of channels) {
    received.channels.push(channel);
    subscribed.set(client.subscribe(channel.id), channel);
  }
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const { topic, schemaName } = subscribed.get(subscriptionId);
  seen.add(topic);
  const bytes = Buffer.from(data.buffer, data.byteOffset, data.byteLength).toString("base64");
  if (received.messages.length < 10 * Number(count)) received.messages.push({ topic, schemaName, timestamp: String(timestamp), bytes });
  if (received.messages.length >= Number(count) && topics.every((wanted) => seen.has(wanted))) client.close();
});
client.on("close", () => {
  received.subprotocol = socket.protocol;
  process.stdout.write(JSON.stringify(received), () => process.exit(0));
});
