// Builds the pages' bundles, each one file without others: ../view/viewer.html, the whole page of splitnerf view, and
// ../report/report.js, the script of report.html, which takes modules of the viewer.
import { createHash } from "node:crypto";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const [viewer, report] = ["view", "report"].map((name) => join(here, "..", name)); // where the bundles go
const text = (name) => readFileSync(join(here, name), "utf8");
const options = {
  bundle: true, minify: true, write: false, absWorkingDir: here, legalComments: "none", charset: "utf8",
};
const scripts = { ...options, format: "iife", target: "es2022" };

/** The hash of what a bundle is made of: tests/python/test_view.py computes the same. */
function hashOf(names) {
  const hash = createHash("sha256");
  for (const name of names) hash.update(`${name}\n`).update(readFileSync(join(here, name)));
  return hash.digest("hex");
}

const tools = ["build.mjs", "package-lock.json", "package.json"];
const licences = (packages) => packages.map((name) => `${name}:\n\n${text(`node_modules/${name}/LICENSE`).trim()}`).join("\n\n\n");
const size = (content) => `${(content.length / 1024).toFixed(0)} KiB`;
/** Within an element of a page nothing in a script may look like the element's end. */
const embeddable = (script) => script.replaceAll("</script", "<\\/script").replaceAll("<!--", "<\\!--");

const script = await build({ ...scripts, entryPoints: ["view/main.js"] });
const style = await build({ ...options, entryPoints: ["view/style.css"] });
const insert = {
  HASH: hashOf([...tools, ...readdirSync(join(here, "view")).sort().map((name) => `view/${name}`)]),
  LICENCES: licences(["three", "uplot"]),
  STYLE: style.outputFiles[0].text,
  SCRIPT: embeddable(script.outputFiles[0].text),
};
const page = text("view/page.html").replace(/\{\{(\w+)\}\}/g, (_, name) => insert[name]);
writeFileSync(join(viewer, "viewer.html"), page);
writeFileSync(join(viewer, "LICENSES"), `viewer.html contains ${insert.LICENCES}\n`);
console.log(`viewer.html: ${size(page)}`);

const reports = await build({ ...scripts, entryPoints: ["report/main.js"], loader: { ".css": "text" }, metafile: true });
const own = Object.keys(reports.metafile.inputs).filter((name) => !name.startsWith("node_modules/")).sort();
const used = licences(["three", "uplot"]);
const head = `/* sources ${hashOf([...tools, ...own])}: ${own.join(" ")}\ncontains ${used}\n*/\n`;
const bundle = head + embeddable(reports.outputFiles[0].text);
writeFileSync(join(report, "report.js"), bundle);
writeFileSync(join(report, "LICENSES"), `report.js contains ${used}\n`);
console.log(`report.js: ${size(bundle)}`);
