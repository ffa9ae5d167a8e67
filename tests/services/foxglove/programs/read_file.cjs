// Reads a recording with Foxglove's own reader (@mcap/core), compares the schemas of Foxglove's types
// with those that Foxglove publishes (@foxglove/schemas), and checks every message by its schema (ajv).
// Prints one JSON object. Called by test_other_readers.py: node read_file.cjs FILE
const fs = require("fs");
const { McapIndexedReader } = require("@mcap/core");
const official = require("@foxglove/schemas/jsonschema");
const fzstd = require("fzstd");
const Ajv = require("ajv");

const file = fs.readFileSync(process.argv[2]);
const readable = {
  size: async () => BigInt(file.length),
  read: async (offset, length) => file.subarray(Number(offset), Number(offset + length)),
};
const zstd = (data, size) => fzstd.decompress(new Uint8Array(data), new Uint8Array(Number(size)));

// Descriptions and comments are for people.
const meaning = (schema) =>
  JSON.stringify(schema, (name, value) =>
    name === "$comment" || (name === "description" && typeof value === "string") ? undefined : value,
  );

// The schema of a message cannot say that a value may be null, because Foxglove's parser cannot.
const isView = (channel) => channel.topic.startsWith("foxglove/");
const withoutNull = (_, value) => (value === null ? undefined : value);
const nothingRequired = (name, value) => (name === "required" ? undefined : value);

async function main() {
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers: { zstd } });
  const ajv = new Ajv({ strict: false });
  const counts = {}, schemas = {}, wrong = {}, same = {}, checks = new Map();
  for await (const message of reader.readMessages()) {
    const channel = reader.channelsById.get(message.channelId);
    if (!checks.has(channel.id)) {
      const schema = reader.schemasById.get(channel.schemaId);
      const parsed = JSON.parse(Buffer.from(schema.data).toString());
      schemas[channel.topic] = schema.name;
      if (schema.name.startsWith("foxglove.")) {
        same[schema.name] = meaning(parsed) === meaning(official[schema.name.slice(9)]);
      }
      const promised = isView(channel) ? parsed : JSON.parse(JSON.stringify(parsed, nothingRequired));
      checks.set(channel.id, ajv.compile(promised));
    }
    counts[channel.topic] = (counts[channel.topic] ?? 0) + 1;
    const check = checks.get(channel.id);
    const data = Buffer.from(message.data).toString();
    if (!check(isView(channel) ? JSON.parse(data) : JSON.parse(data, withoutNull))) {
      wrong[channel.topic] = ajv.errorsText(check.errors);
    }
  }
  const attachments = [];
  for await (const attachment of reader.readAttachments()) attachments.push(attachment.name);
  console.log(JSON.stringify({ counts, schemas, wrong, same, attachments }));
}

main();
