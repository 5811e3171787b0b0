// The line to the server: what it tells as long as the page is open, and whether it is still there.
import { readScene } from "./server.js";

const SILENCE = 8000; // milliseconds without a word after which the server counts as gone; it says something every two seconds

/** Calls `heard` with each state of the server, and shows a line while it is gone. */
export class Connection {
  constructor(heard) {
    this.heard = heard;
    this.line = document.getElementById("lost");
    this.open();
    setInterval(() => this.last && !this.closed && performance.now() - this.last > SILENCE && this.lose(), 1000);
  }

  open() {
    this.source = new EventSource("events");
    this.source.onmessage = ({ data }) => this.hear(JSON.parse(data));
    this.source.onerror = () => this.lose();
  }

  hear(state) {
    this.last = performance.now();
    this.lost = false;
    this.line.textContent = "";
    this.heard(state);
  }

  /** The server has said that it ends: nothing more is expected of it. */
  close(words) {
    this.closed = true;
    this.source.close();
    this.line.classList.add("calm");
    this.line.textContent = words;
  }

  /** Tries again until the server is back; one that knows another address says so. */
  async lose() {
    if (this.closed) return;
    this.lost = true;
    this.line.textContent = "The connection to splitnerf is lost; the page tries again. Does the command still run?";
    if (this.source.readyState !== EventSource.CLOSED) return;
    try {
      await readScene();
      this.open();
    } catch (error) {
      this.line.textContent = error.message;
    }
  }
}
