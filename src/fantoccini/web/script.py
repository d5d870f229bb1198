"""What every page does in the browser beside what viser's client does."""

SCRIPT = """
(() => {
  // viser's client flies its camera with these keys; here they are commands of the page. Commands
  // listen on the root element, the camera on the document: there the event ends.
  const keys = new Set(["KeyW", "KeyA", "KeyS", "KeyD", "KeyQ", "KeyE"]);
  document.addEventListener("keydown", (event) => {
    if (keys.has(event.code)) event.stopImmediatePropagation();
  });
  // On a phone viser's panel lies over the picture: it starts folded.
  document.addEventListener("DOMContentLoaded", () => {
    if (!matchMedia("(max-width: 36em)").matches) return;
    const watch = new MutationObserver(() => {
      const panel = document.querySelector('div[style*="fixed"][style*="max-height: 60%"]');
      const bar = panel && panel.querySelector('div[style*="cursor: pointer"]');
      if (!bar) return;
      watch.disconnect();
      bar.click();
    });
    watch.observe(document, {childList: true, subtree: true});
  });
})();
"""
