// Print what the Khronos validator says of a glTF file: node gltf_validator.cjs PACKAGES FILE
const { readFileSync } = require("node:fs");
const { dirname, join } = require("node:path");
const [packages, file] = process.argv.slice(2);
const { validateBytes } = require(`${packages}/node_modules/gltf-validator`);
const externalResourceFunction = async (uri) => new Uint8Array(readFileSync(join(dirname(file), decodeURIComponent(uri))));

validateBytes(new Uint8Array(readFileSync(file)), { maxIssues: 0, externalResourceFunction })
  .then((report) => console.log(JSON.stringify(report.issues.messages)))
  .catch((error) => console.log(JSON.stringify([{ code: String(error), severity: 0, pointer: "" }])));
