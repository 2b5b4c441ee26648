// Validates GLB files with the glTF validator of Khronos: node gltf_validate.js FILE... ; exit code 1 on any error or warning.
// The npm package `gltf-validator` is looked for in the node_modules of the current folder.
const fs = require("fs");
const { createRequire } = require("module");
const path = require("path");
const validator = createRequire(path.join(process.cwd(), "here.js"))("gltf-validator");

(async () => {
  let faults = 0;
  for (const file of process.argv.slice(2)) {
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), { maxIssues: 20 });
    const { numErrors, numWarnings, numInfos } = report.issues;
    console.log(`${file}: ${numErrors} errors, ${numWarnings} warnings, ${numInfos} infos`);
    for (const issue of report.issues.messages) {
      console.log(`  ${issue.severity} ${issue.code} ${issue.pointer || ""}: ${issue.message}`);
    }
    faults += numErrors + numWarnings;
  }
  process.exit(faults ? 1 : 0);
})();
