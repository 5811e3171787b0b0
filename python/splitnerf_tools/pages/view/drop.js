// Lights that are dropped onto the page.

const field = (id) => document.getElementById(id);

/** Calls `opened` with each file that is dropped. */
export function listenForFiles(opened) {
  let depth = 0; // dragenter and dragleave come for every element under the pointer
  const show = (change) => {
    depth = Math.max(0, depth + change);
    field("drop").hidden = depth === 0;
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
