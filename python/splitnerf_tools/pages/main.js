// The one script of all pages: report.html carries its data, the page of `splitnerf view` asks its server.
import { report } from "./report/main.js";
import { viewer } from "./view/main.js";

(document.getElementById("data") ? report : viewer)();
