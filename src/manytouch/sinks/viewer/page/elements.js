// Builds parts of the page. Text is only ever set as text, never parsed as HTML: recordings contain names.

/** An element from a description: a text, or [tag, { class, style }, ...children]. */
export function build(description) {
  if (!Array.isArray(description)) return document.createTextNode(String(description));
  const [tag, { class: className = "", style = {}, data = null, span = 1 }, ...children] = description;
  const element = document.createElement(tag);
  element.className = className;
  Object.assign(element.style, style);
  if (data !== null) element.dataset.id = data;
  if (span > 1) element.colSpan = span;
  element.append(...children.map(build));
  return element;
}

/** Replace the content of an element, if it differs from what is shown. */
export function render(parent, descriptions) {
  const key = JSON.stringify(descriptions);
  if (parent.dataset.rendered === key) return;
  parent.dataset.rendered = key;
  parent.replaceChildren(...descriptions.map(build));
}
