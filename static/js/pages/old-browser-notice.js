// For browsers too old for the page's modules: says so, where the page would wait for ever. In the JavaScript of 2009, as
// what reads it may know no other. The modules say that they run by data-runs at the root of the page.
(function () {
  'use strict';
  var script = document.currentScript || document.querySelector('script[data-show]');

  function each(names, does) {
    for (var i = 0, all = (names || '').split(' '); i < all.length; i += 1) {
      var found = all[i] && document.getElementById(all[i]);
      if (found) does(found);
    }
  }

  function count(kind, reason) {
    var token = document.querySelector('[name=form_token]'), request = new XMLHttpRequest();
    request.open('POST', script.getAttribute('data-count'));
    request.setRequestHeader('Content-Type', 'application/x-www-form-urlencoded');
    request.send('form_token=' + encodeURIComponent(token.value) + '&kind=' + kind + '&reason=' + reason);
  }

  window.addEventListener('load', function () {
    if (document.documentElement.getAttribute('data-runs')) return;
    each(script.getAttribute('data-hide'), function (element) { element.hidden = true; });
    each(script.getAttribute('data-show'), function (element) { element.hidden = false; });
    if (!script.getAttribute('data-count')) return;
    count('opened', '');
    count('unsuitable', 'browser');
  });
})();
