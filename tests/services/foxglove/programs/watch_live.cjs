// Watches a live server with Foxglove's own client (@foxglove/ws-protocol), and tries to command.
// Prints one JSON object. Called by test_live_server.py: node watch_live.cjs PORT
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const WebSocket = require("ws");

const MESSAGES = 40; // of all channels together; then it has seen enough
// The server speaks the same protocol under a newer name than this client asks for.
const ws = new WebSocket(`ws://127.0.0.1:${process.argv[2]}`, ["foxglove.sdk.v1"]);
const client = new FoxgloveClient({ ws });
const seen = { info: null, channels: {}, first: {}, times: {}, parameters: {}, statuses: [] };
const topics = new Map();
let messages = 0;

client.on("serverInfo", (info) => {
  seen.info = info;
  client.getParameters([], "all");
  // What follows must be refused.
  client.setParameters([{ name: "control.depth.kp", value: 99 }], "set");
  const channel = client.advertise({ topic: "pilot/command", encoding: "json", schemaName: "X" });
  client.sendMessage(channel, new TextEncoder().encode('{"surge": 1}'));
  client.sendServiceCallRequest({
    serviceId: 1, callId: 1, encoding: "json", data: new DataView(new ArrayBuffer(0)),
  });
});
client.on("advertise", (channels) => {
  for (const channel of channels) {
    seen.channels[channel.topic] = channel.schemaName;
    topics.set(client.subscribe(channel.id), channel.topic);
  }
});
client.on("parameterValues", ({ parameters, id }) => {
  const values = Object.fromEntries(parameters.map(({ name, value }) => [name, value]));
  seen.parameters[id ?? "told"] = values;
});
client.on("status", ({ message }) => seen.statuses.push(message));
client.on("serviceCallFailure", ({ message }) => seen.statuses.push(message));
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const topic = topics.get(subscriptionId);
  const text = new TextDecoder().decode(data);
  seen.first[topic] ??= JSON.parse(text);
  seen.times[topic] ??= String(timestamp);
  messages += 1;
  if (messages === MESSAGES) client.close();
});
client.on("error", (error) => {
  console.error(String(error.message ?? error));
  process.exit(1);
});
client.on("close", () => console.log(JSON.stringify(seen)));
