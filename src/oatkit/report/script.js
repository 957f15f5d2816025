"use strict";
// The page works without this: it only lets the left and right arrow keys turn wavelengths from anywhere on the page.
document.addEventListener("keydown", (event) => {
  const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (!step || event.altKey || event.ctrlKey || event.metaKey || event.target.matches("input, pre, .scroll")) return;
  for (const row of document.querySelectorAll(".wavelengths")) {
    const choices = [...row.querySelectorAll("input")];
    const next = choices.findIndex((choice) => choice.checked) + step;
    choices[(next + choices.length) % choices.length].checked = true;
  }
});
