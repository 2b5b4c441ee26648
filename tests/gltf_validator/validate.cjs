// Validates GLB and glTF files with the glTF validator of Khronos:
//
//   node validate.cjs FOLDER FILE... [-- INPUT...]
//
// FOLDER is where `npm ci` was run with the package.json beside this script. Exit code 1 on any error or warning of a kind
// that none of the inputs has.
const fs = require("fs");
const { createRequire } = require("module");
const path = require("path");

const [folder, ...all] = process.argv.slice(2);
const files = all.includes("--") ? all.slice(0, all.indexOf("--")) : all;
const inputs = all.slice(files.length + 1);
const validator = createRequire(path.resolve(folder, "here.js"))("gltf-validator");

const ignoredIssues = [
  // Viewers compute the tangents that the maps were made with (MikkTSpace), as the format asks where there are none.
  "MESH_PRIMITIVE_GENERATED_TANGENT_SPACE",
  // Where a mesh hangs among the nodes stays as it was in the input.
  "NODE_SKINNED_MESH_NON_ROOT",
  "NODE_SKINNED_MESH_LOCAL_TRANSFORMS",
  "NODE_SKINNED_MESH_WITHOUT_SKIN",
];

async function issuesOf(file) {
  const beside = (uri) => fs.promises.readFile(path.resolve(path.dirname(file), decodeURIComponent(uri)));
  const externalResourceFunction = async (uri) => new Uint8Array(await beside(uri));
  const options = { maxIssues: 20, ignoredIssues, externalResourceFunction };
  // A file that is no glTF at all is none of an input's faults.
  const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), options).catch((error) => ({
    issues: { messages: [{ severity: 0, code: "NO_GLTF", message: String(error) }] },
  }));
  return report.issues.messages.filter((issue) => issue.severity < 2);
}

(async () => {
  const known = new Set();
  for (const file of inputs) for (const issue of await issuesOf(file)) known.add(issue.code);
  let faults = 0;
  for (const file of files) {
    const issues = (await issuesOf(file)).filter((issue) => !known.has(issue.code));
    faults += issues.length;
    if (issues.length) console.log(`${file}:`);
    for (const issue of issues) console.log(`  ${issue.code} ${issue.pointer || ""}: ${issue.message}`);
  }
  process.exit(faults ? 1 : 0);
})();
