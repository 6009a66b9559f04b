// Colour maps that are readable with any common colour vision, and colours that distinguish contacts.

const ANCHORS = {
  cividis: "00224e 123570 3b496c 575d6d 707173 8a8678 a59c74 c3b369 e1cc55 fee838",
  viridis: "440154 482878 3e4989 31688e 26828e 1f9e89 35b779 6ece58 b5de2b fde725",
  ember: "0d0b1f 2b1144 56106e 84206b b1325a d94d3d f1731d fca50a f6d746 fcffa4",
  grey: "1c2024 3a4046 59616a 77818b 96a1ac b4bec8 d3dbe2 f2f6f9",
  balance: "10528a 2f78b5 69a4d2 a9cbe5 e4edf3 f5f3ee f3dcc0 e5b07a cc7b35 9c4f0f 6e3005",
};
export const MAPS = ["cividis", "viridis", "ember", "grey"];
export const DIVERGING = "balance";

const tables = new Map();

/** 256 x RGBA bytes of a colour map. */
export function table(name) {
  if (!tables.has(name)) {
    const anchors = ANCHORS[name].split(" ").map((hex) => [0, 2, 4].map((at) => parseInt(hex.slice(at, at + 2), 16)));
    const bytes = new Uint8Array(256 * 4);
    for (let i = 0; i < 256; i++) {
      const place = (i / 255) * (anchors.length - 1);
      const low = Math.min(Math.floor(place), anchors.length - 2);
      for (let c = 0; c < 3; c++) bytes[4 * i + c] = anchors[low][c] + (place - low) * (anchors[low + 1][c] - anchors[low][c]);
      bytes[4 * i + 3] = 255;
    }
    tables.set(name, bytes);
  }
  return tables.get(name);
}

// Colours of Okabe and Ito; the number next to each contact identifies it without colour.
const CONTACTS = ["#e69f00", "#56b4e9", "#d55e00", "#009e73", "#cc79a7", "#0072b2", "#f0e442"];
export const contactColour = (id) => CONTACTS[id % CONTACTS.length];

/** A colour of the style sheet, as it is now. */
export const styled = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
