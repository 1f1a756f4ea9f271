// Tells a browser that is too old for the page's modules, instead of leaving the page waiting forever. It is written in
// the JavaScript of 2009, which such browsers can parse. The modules set data-runs at the root of the page.
(function () {
  'use strict';
  var current = document.currentScript || document.querySelector('script[data-show]');
  if (!current) return;
  var script = current;

  /** @type {(names: string | null, hide: boolean) => void} */
  function setHidden(names, hide) {
    for (var i = 0, all = (names || '').split(' '); i < all.length; i += 1) {
      var found = all[i] ? document.getElementById(all[i]) : null;
      if (found) found.hidden = hide;
    }
  }

  /** @type {(address: string, kind: string, reason: string) => void} */
  function count(address, kind, reason) {
    var token = /** @type {HTMLInputElement | null} */ (document.querySelector('[name=form_token]'));
    var request = new XMLHttpRequest();
    request.open('POST', address);
    request.setRequestHeader('Content-Type', 'application/x-www-form-urlencoded');
    request.send('form_token=' + encodeURIComponent(token ? token.value : '') + '&kind=' + kind + '&reason=' + reason);
  }

  window.addEventListener('load', function () {
    if (document.documentElement.getAttribute('data-runs')) return;
    setHidden(script.getAttribute('data-hide'), true);
    setHidden(script.getAttribute('data-show'), false);
    var address = script.getAttribute('data-count');
    if (!address) return;
    count(address, 'opened', '');
    count(address, 'unsuitable', 'browser');
  });
})();
