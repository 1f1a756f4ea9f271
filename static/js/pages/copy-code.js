// The button that copies the completion code.

const [button, code, note] = ['copy', 'code', 'code-note'].map((id) => document.getElementById(id));

if (button) {
  button.hidden = false;
  button.addEventListener('click', async () => {
    try {
      await navigator.clipboard.writeText(code.textContent.trim());
      note.textContent = button.dataset.copied;
    } catch {
      getSelection().selectAllChildren(code);
      note.textContent = button.dataset.selected;
    }
  });
}
