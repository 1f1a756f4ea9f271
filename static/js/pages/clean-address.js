// A recruiter's parameters are in the page already: out of the address bar, where a shared link or a screenshot would
// tell who somebody is. A reload of this tab puts them back; nothing is kept anywhere else.

const query = new URLSearchParams(location.search);
const names = [...query.keys()].filter((name) => name !== 'lang');
if (names.length > 0) {
  names.forEach((name) => query.delete(name));
  history.replaceState({ query: location.search }, '', location.pathname + (String(query) ? `?${query}` : ''));
} else if (history.state?.query) {
  location.replace(location.pathname + history.state.query);
}
