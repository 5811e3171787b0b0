// Opens a page in Chromium and does what standard input asks, a step in JSON on each line; tests/python/looking_at.py
// writes them, and hears of each step when it is done. Prints {"console": [...], "texts": {...}} at the end, as JSON; pictures go
// to the paths that steps name.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { basename } from "node:path";
import { createInterface } from "node:readline";

const [packages, executablePath, url] = process.argv.slice(2);
const { chromium } = createRequire(`${packages}/package.json`)("playwright-core");
const args = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--force-color-profile=srgb"];
const browser = await chromium.launch({ executablePath, args, chromiumSandbox: process.getuid() !== 0 });
const page = await browser.newPage();
page.setDefaultTimeout(120000); // a busy machine without a GPU draws for seconds
const told = { console: [], texts: {} };
let open = 0; // requests
const ends = (request) => !request.url().endsWith("/events"); // that stream lasts as long as the page
page.on("request", (request) => (open += ends(request)));
for (const end of ["requestfinished", "requestfailed"]) page.on(end, (request) => (open -= ends(request)));
page.on("dialog", (dialog) => dialog.accept());
page.on("console", (message) => told.console.push(`${message.type()}: ${message.text()}`));
page.on("pageerror", (error) => told.console.push(`error: ${error.stack}`));

/** Waits until nothing is loaded and two pictures are equal. */
async function settled() {
  for (let last = "", limit = Date.now() + 200000; ; ) {
    if (Date.now() > limit) throw new Error(`the page does not come to rest; ${open} requests are open`);
    const now = open ? "" : (await page.screenshot()).toString("base64");
    if (now && now === last) return;
    last = now;
    await page.waitForTimeout(300);
  }
}

const steps = {
  before: ({ script }) => page.addInitScript(script), // in the page, before its own
  size: ({ width, height }) => page.setViewportSize({ width, height }),
  open: async () => {
    await page.goto(url);
    await page.waitForSelector("body.ready");
  },
  wait: async ({ script }) => {
    for (const limit = Date.now() + 120000; !(await page.evaluate(script)); await page.waitForTimeout(100))
      if (Date.now() > limit) throw new Error(`${script}: is not true; ${await page.evaluate("document.body.innerText")}`);
  },
  press: ({ selector }) => page.click(selector),
  style: ({ content }) => page.addStyleTag({ content }),
  key: ({ key }) => page.keyboard.press(key),
  focus: ({ selector }) => page.focus(selector),
  click: ({ x, y }) => page.mouse.click(x, y),
  point: async ({ selector, place, press }) => {
    const part = page.locator(selector).first();
    await part.scrollIntoViewIfNeeded();
    const { x, y, width, height } = await part.boundingBox();
    const target = [x + place[0] * width, y + place[1] * height];
    await (press ? page.mouse.click(...target) : page.mouse.move(...target));
  },
  drag: async ({ from, to }) => {
    await page.mouse.move(...from);
    await page.mouse.down();
    await page.mouse.move(...to, { steps: 4 });
    await page.mouse.up();
  },
  set: ({ selector, value }) =>
    page.$eval(
      selector,
      (field, given) => {
        if (typeof given === "boolean") field.checked = given;
        else field.value = given;
        field.dispatchEvent(new Event("input", { bubbles: true }));
      },
      value,
    ),
  drop: async ({ path }) => {
    const content = readFileSync(path).toString("base64");
    const data = await page.evaluateHandle(
      ([name, text]) => {
        const transfer = new DataTransfer();
        transfer.items.add(new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], name));
        return transfer;
      },
      [basename(path), content],
    );
    await page.dispatchEvent("body", "dragenter", { dataTransfer: data });
    await page.dispatchEvent("body", "drop", { dataTransfer: data });
  },
  part: ({ selector, path }) => page.locator(selector).first().screenshot({ path }),
  picture: ({ path }) => page.screenshot({ path }),
  text: async ({ name, script }) => (told.texts[name] = await page.evaluate(script)),
};

for await (const line of createInterface({ input: process.stdin })) {
  const step = JSON.parse(line);
  await steps[step.do](step);
  if (!step.restless && (step.do !== "size" || page.url() !== "about:blank")) await settled();
  console.log("done");
}
console.log(JSON.stringify(told));
await browser.close();
