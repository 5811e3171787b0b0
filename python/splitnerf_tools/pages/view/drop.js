// Lights that are dropped onto the page, or opened from a file.
import { element } from "./elements.js";

/** Calls `opened` with each file that is dropped. */
export function listenForFiles(opened) {
  const sign = element("div", { id: "drop", hidden: true }, "Drop an .hdr or .exr: it becomes the light");
  document.body.append(sign);
  let depth = 0; // dragenter and dragleave come for every element under the pointer
  const show = (change) => {
    depth = Math.max(0, depth + change);
    sign.hidden = depth === 0;
  };
  addEventListener("dragenter", (event) => {
    event.preventDefault();
    show(1);
  });
  addEventListener("dragleave", () => show(-1));
  addEventListener("dragover", (event) => event.preventDefault());
  addEventListener("drop", (event) => {
    event.preventDefault();
    show(-depth);
    if (event.dataTransfer.files.length) opened(event.dataTransfer.files[0]);
  });
}

/** What stands below the choice of a light: that files may be dropped, and a button that opens one. */
export function opener(opened) {
  const file = element("input", { type: "file", accept: ".hdr,.exr", hidden: true, onchange: () => file.files.length && opened(file.files[0]) });
  const open = element("button", { type: "button", onclick: () => file.click() }, "open one");
  return [element("p", { class: "hint" }, "or drop an .hdr or .exr anywhere, or ", open), file];
}
