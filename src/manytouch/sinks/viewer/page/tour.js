// Three steps for a first visit, where the sheet can be pressed; shown once per browser.

const find = (id) => document.getElementById(id);
const KEY = "tour-done";
const STEPS = [
  ["mode", "Press the sheet", "Choose Press, then press the surface with the mouse or a finger. With keep fingers several stay on it."],
  ["contacts", "Read the contacts", "Place, depth and force of each contact, ± one standard deviation; the line below it is the truth of the simulation."],
  ["measure-empty", "Measure", "Choose View & measure and click the surface: the depth there; of two points also the profile. ? lists all keys."],
];

export class Tour {
  constructor() {
    this.step = null;
    find("tour-next").addEventListener("click", () => this.show(this.step + 1));
    find("tour-skip").addEventListener("click", () => this.end());
    find("tour").addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.end();
    });
  }

  begin() {
    if (this.step === null && !localStorage.getItem(KEY)) this.show(0);
  }

  show(step) {
    if (step >= STEPS.length) return this.end();
    this.step = step;
    const [target, title, text] = STEPS[step];
    find("tour").hidden = false;
    find("tour-title").textContent = `${step + 1} of ${STEPS.length}: ${title}`;
    find("tour-text").textContent = text;
    find("tour-next").textContent = step + 1 < STEPS.length ? "Next" : "Done";
    this.point(target);
  }

  end() {
    localStorage.setItem(KEY, "yes");
    find("tour").hidden = true;
    this.point(null);
  }

  point(target) {
    for (const marked of document.querySelectorAll(".pointed")) marked.classList.remove("pointed");
    if (target) find(target).closest(target === "mode" ? ".segments" : ".card").classList.add("pointed");
  }
}
