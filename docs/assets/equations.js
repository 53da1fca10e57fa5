// Equations that pymdownx.arithmatex marked: \(in the line\) and \[on their own\].
for (const place of document.querySelectorAll(".arithmatex")) {
  const text = place.textContent.trim();
  katex.render(text.slice(2, -2), place, { displayMode: text.startsWith("\\["), throwOnError: true });
}
