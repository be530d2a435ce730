// The log: what the daemon tells of, the newest last, as long as the page is open.
import { byId, element } from "./dom.js";

const most = 500;

export function addEvent({ time, kind, message }) {
  const list = byId("events");
  const atEnd = list.scrollTop + list.clientHeight >= list.scrollHeight - 4;
  const at = time === undefined ? new Date() : new Date(time);
  list.append(element("li", {}, element("time", { datetime: at.toISOString() }, at.toLocaleTimeString("sv")),
    element("span", {}, kind), element("span", {}, message)));
  while (list.children.length > most) list.firstElementChild.remove();
  if (atEnd) list.scrollTop = list.scrollHeight;
}
