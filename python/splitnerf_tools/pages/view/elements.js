// Parts of the page that several sections have.

/** An element with attributes and contents; a name that begins with "on" is a listener. */
export function element(tag, attributes = {}, ...contents) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value != null) made.setAttribute(name, value);
  }
  made.append(...contents);
  return made;
}

export const addStyle = (content) => document.head.append(element("style", {}, content));

/** Buttons of which one is chosen, by pointer or arrow keys; `chosen` gets its number, at once that of the first. */
export function tabs(label, names, chosen) {
  const buttons = names.map((name, i) => element("button", { type: "button", role: "radio", onclick: () => choose(i) }, name));
  const choose = (number) => {
    buttons.forEach((button, i) => {
      button.setAttribute("aria-checked", String(i === number));
      button.tabIndex = i === number ? 0 : -1;
    });
    chosen(number);
  };
  const keys = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 };
  const row = element("div", { class: "tabs", role: "radiogroup", "aria-label": label }, ...buttons);
  row.addEventListener("keydown", (event) => {
    if (!(event.key in keys)) return;
    event.preventDefault();
    const next = (buttons.indexOf(document.activeElement) + keys[event.key] + buttons.length) % buttons.length;
    choose(next);
    buttons[next].focus();
  });
  choose(0);
  return row;
}

/** A line between two pictures that is dragged: `nodes` stand above them, `moved` is called after each move. */
export class Divider {
  constructor(label, moved) {
    this.line = element("div", { class: "divider" });
    this.tags = [element("span", { class: "tag" }), element("span", { class: "tag other" })];
    this.slider = element("input", { type: "range", min: 0, max: 100, step: 0.5, value: 50, "aria-label": label });
    this.nodes = [this.line, ...this.tags, this.slider];
    this.slider.addEventListener("input", moved);
    this.slider.addEventListener("pointerdown", () => (this.before = this.slider.value));
    this.slider.addEventListener("pointercancel", () => {
      this.slider.value = this.before; // the finger scrolls the page
      moved();
    });
  }

  /** Cuts the left picture; a share of 0 or 100 % where there is one alone. */
  cut(left, share = Number(this.slider.value)) {
    left.style.clipPath = `inset(0 ${100 - share}% 0 0)`;
    this.line.style.left = `${share}%`;
    this.tags.forEach((tag, i) => tag.classList.toggle("covered", !this.slider.hidden && (i ? share > 85 : share < 15)));
  }
}

/** Where the pointer is within an element, as shares of its width and height in [0, 1). */
export function placeIn(target, event) {
  const { left, top, width, height } = target.getBoundingClientRect();
  const share = (value) => Math.min(Math.max(value, 0), 0.999999);
  return [share((event.clientX - left) / width), share((event.clientY - top) / height)];
}

/** The bytes of base64 of gzip. */
export async function unpacked(text) {
  const binary = atob(text.trim());
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = binary.charCodeAt(i);
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}

/** A number for readers: about so many digits that count, never an exponent of small ones. */
export function short(value, digits = 3) {
  if (!Number.isFinite(value)) return "–";
  if (Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-4)) return value.toExponential(digits - 1).replace(/\.?0+e/, "e");
  return String(Number(value.toPrecision(digits)));
}
