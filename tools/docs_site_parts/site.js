// Search in titles and texts; PAGES is written before this.
(function () {
  var input = document.getElementById("search"), found = document.getElementById("found");
  var up = document.body.dataset.up;
  input.addEventListener("input", function () {
    var words = input.value.toLowerCase().split(/\s+/).filter(Boolean);
    var hits = words.length ? PAGES.filter(function (page) {
      return words.every(function (word) { return page.x.indexOf(word) >= 0; });
    }) : [];
    var inTitle = function (page) { return page.t.toLowerCase().indexOf(words[0]) >= 0 ? 0 : 1; };
    hits.sort(function (a, b) { return inTitle(a) - inTitle(b); });
    found.replaceChildren.apply(found, hits.slice(0, 12).map(function (page) {
      var item = document.createElement("li"), link = document.createElement("a");
      link.href = up + page.u;
      link.textContent = page.t;
      item.appendChild(link);
      return item;
    }));
  });
})();
