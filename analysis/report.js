// The report's own script: it travels alone. A server shows the report with this script only, known by its hash.

/** @param {Element} text */
async function copy(text) {
  try {
    await navigator.clipboard.writeText(text.textContent);
  } catch {
    // Where a server shows the report, it is apart from the server's pages and may not use the clipboard.
    getSelection().selectAllChildren(text);
    document.execCommand("copy");
    getSelection().removeAllRanges();
  }
}

for (const button of document.querySelectorAll(".paste button")) {
  button.hidden = false;
  button.addEventListener("click", async () => {
    await copy(button.nextElementSibling);
    button.textContent = "Copied";
    setTimeout(() => { button.textContent = "Copy"; }, 1500);
  });
}
