// Prints the report of Khronos' validator for each GLB named, as a JSON list.
import { readFile } from "node:fs/promises";
import validator from "gltf-validator";

const reports = [];
for (const path of process.argv.slice(2)) {
  const report = await validator.validateBytes(new Uint8Array(await readFile(path)), { maxIssues: 100 });
  reports.push({ path, issues: report.issues, info: report.info });
}
console.log(JSON.stringify(reports));
