// Views by the address: #bench, #experiment, #queue, #recordings, #recordings/NAME, #model.
export const views = ["bench", "experiment", "queue", "recordings", "model"];

// shown(view, rest) whenever another view, or another part of it, is asked for.
export function startRouter(shown) {
  const route = () => {
    const [view, ...rest] = location.hash.slice(1).split("/");
    const now = views.includes(view) ? view : "bench";
    for (const name of views) {
      document.querySelector(`section[data-view="${name}"]`).hidden = name !== now;
      const link = document.querySelector(`nav a[href="#${name}"]`);
      if (name === now) link.setAttribute("aria-current", "page");
      else link.removeAttribute("aria-current");
    }
    document.title = `${now[0].toUpperCase()}${now.slice(1)} · ferrobench`;
    let part = rest.join("/");
    try {
      part = decodeURIComponent(part);
    } catch {
      // taken as it stands: the daemon says that there is no such name
    }
    shown(now, part);
  };
  addEventListener("hashchange", () => {
    route();
    scrollTo(0, 0);
  });
  route();
}
