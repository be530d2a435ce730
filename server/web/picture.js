// A chart as a picture for other programs.
import { element } from "./dom.js";

export const pictureScale = 2.5; // of text of 12 px: legible in print at half of a page's width

// A canvas with the picture below its title, whose it is, and its legend.
export function withHead(picture, { title, whose, curves, ink, back }) {
  const px = (n) => n * pictureScale;
  const canvas = element("canvas", { width: picture.width });
  const ctx = canvas.getContext("2d");
  const font = (size, weight = 400) => (ctx.font = `${weight} ${px(size)}px system-ui`);
  font(12);
  const chip = px(22);
  const lines = [[]];
  let left = 0;
  for (const curve of curves) {
    const width = chip + ctx.measureText(curve.name).width + px(14);
    if (left > 0 && left + width > picture.width - px(20)) {
      lines.push([]);
      left = 0;
    }
    lines.at(-1).push({ curve, left });
    left += width;
  }
  const head = px(28 + (whose ? 18 : 0) + (curves.length ? 18 * lines.length : 0) + 6);
  canvas.height = picture.height + head; // which clears it
  ctx.fillStyle = back;
  ctx.fillRect(0, 0, canvas.width, canvas.height);
  ctx.drawImage(picture, 0, head);
  let y = px(22);
  const text = (words, x = 0) => {
    ctx.fillStyle = ink;
    ctx.fillText(words, px(10) + x, y);
  };
  font(15, 600);
  text(title);
  font(12);
  if (whose) {
    y += px(18);
    text(whose);
  }
  for (const line of lines) {
    y += px(18);
    for (const { curve, left: x } of line) {
      ctx.fillStyle = curve.colour();
      ctx.fillRect(px(10) + x, y - px(5), px(16), px(3));
      text(curve.name, x + chip);
    }
  }
  return canvas;
}
