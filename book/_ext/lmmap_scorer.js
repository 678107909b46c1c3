// Chapters first, then the reference, and the modules' pages last; within each, Sphinx's own order.
var Scorer = {
  score: ([page, , , , score]) => score - (page.startsWith("book/api") ? 1000 : /^book\/(check|notation|provenance|bibliography)$/.test(page) ? 20 : 0),
  objNameMatch: 11, objPartialMatch: 6, objPrio: { 0: 15, 1: 5, 2: -5 }, objPrioDefault: 0,
  title: 15, partialTitle: 7, term: 5, partialTerm: 2,
};
