// Places of labels that do not cover each other, nor what else is in the pane. Rectangles: [left, top, width, height].

const GAP = 3;
/** Width of the pane of the surface below which the colours are above the surface; style.css has it too. */
export const NARROW_PX = 520;

export function overlaps([a, b, w, h], [c, d, v, g]) {
  return a < c + v + GAP && c < a + w + GAP && b < d + g + GAP && d < b + h + GAP;
}

/** Left and top of a label of a size near a point, inside of the pane, free of the rectangles in `taken`. */
export function freePlace([x, y], [width, height], [wide, high], taken, away = 12) {
  const left = Math.min(Math.max(x - width / 2, 2), Math.max(wide - width - 2, 2));
  const places = [[left, y - height - away], [left, y + away], [x + away, y - height / 2], [x - away - width, y - height / 2]];
  for (let step = 1; step < 12; step++) for (const sign of [-1, 1]) {
    const top = y - height / 2 + sign * (away + height / 2 + step * (height + GAP));
    places.push([left, top], [Math.min(x + away, wide - width - 2), top], [Math.max(x - away - width, 2), top]);
  }
  const isInside = ([a, b]) => a >= 0 && b >= 0 && a + width <= wide && b + height <= high;
  const inside = places.filter(isInside);
  const isFree = (place) => !taken.some((other) => overlaps([...place, width, height], other));
  return inside.find(isFree) ?? nearestFree([x - width / 2, y - height / 2], [width, height], [wide, high], isFree)
    ?? inside[0] ?? [left, Math.max(y - height - away, 0)];
}

/** The free place nearest to a wanted one, anywhere in the pane; null if it is full. */
function nearestFree([x, y], [width, height], [wide, high], isFree) {
  let best = null, least = Infinity;
  for (let top = 2; top + height <= high - 2; top += height + GAP + 1) for (let left = 2; left + width <= wide - 2; left += 0.25 * width) {
    const away = Math.hypot(left - x, top - y);
    if (away < least && isFree([left, top])) { best = [left, top]; least = away; }
  }
  return best;
}

/** Move a name that reaches beyond the pane inside of it; gives its rectangle. */
function moveInside(element, rectangle, { width: wide, height: high }) {
  element.style.margin = "0";
  const [left, top, width, height] = rectangle(element);
  const x = Math.min(Math.max(left, 2), wide - width - 2), y = Math.min(Math.max(top, 2), high - height - 2);
  element.style.margin = `${y - top}px 0 0 ${x - left}px`;
  return [x, y, width, height];
}

/** Move the tags of a pane (elements that a renderer has positioned) apart; hide axis labels that something covers. */
export function separate(container, tags, axes, obstacles) {
  const box = container.getBoundingClientRect();
  const rectangle = (element) => {
    const { left, top, width, height } = element.getBoundingClientRect();
    return [left - box.left, top - box.top, width, height];
  };
  const taken = obstacles.filter((element) => element.offsetParent !== null).map(rectangle);
  const names = axes.filter((element) => element.style.display !== "none");
  for (const element of names.filter(({ className }) => className.includes("name"))) taken.push(moveInside(element, rectangle, box));
  taken.push(...names.filter(({ className }) => className.includes("depth")).map(rectangle)); // tags leave room for them
  for (const element of tags) element.style.margin = "0";
  const wanted = tags.filter((element) => element.style.display !== "none").map((element) => [element, rectangle(element)]);
  wanted.sort((a, b) => a[1][1] - b[1][1]);
  for (const [element, [left, top, width, height]] of wanted) {
    const place = [left, top, width, height];
    const isFree = left >= 0 && top >= 0 && left + width <= box.width && top + height <= box.height && !taken.some((other) => overlaps(place, other));
    const [x, y] = isFree ? [left, top] : freePlace([left + width / 2, top + height], [width, height], [box.width, box.height], taken, 0);
    element.style.margin = `${y - top}px 0 0 ${x - left}px`;
    taken.push([x, y, width, height]);
  }
  const shown = [];
  for (const element of names) {
    const place = rectangle(element), isTaken = /name|depth/.test(element.className);
    const others = isTaken ? taken.filter((other) => Math.abs(other[0] - place[0]) > 0.5 || Math.abs(other[1] - place[1]) > 0.5) : [...taken, ...shown];
    const isCovered = others.some((other) => overlaps(place, other));
    element.style.visibility = isCovered ? "hidden" : "";
    if (!isCovered) shown.push(place);
  }
}
