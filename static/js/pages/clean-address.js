// Takes a recruiter's parameters out of the address bar, where a shared link or a screenshot would identify the
// participant. The page has them already. A reload of this tab puts them back; they are stored nowhere else.

const query = new URLSearchParams(location.search);
const names = [...query.keys()].filter((name) => name !== 'lang');
if (names.length > 0) {
  names.forEach((name) => query.delete(name));
  const rest = String(query) ? `?${query}` : '';
  history.replaceState({ query: location.search }, '', location.pathname + rest);
} else if (history.state?.query) {
  location.replace(location.pathname + history.state.query);
}
