#include <string>

#include "coordinator/page/page_layout.hpp"
#include "coordinator/report/review_documents.hpp"

namespace proofmass::coordinator {

namespace {

// Beside review_style(), which tables of results and charts need. The colours have a contrast
// of 4.5 at least, in both themes.
constexpr std::string_view style = R"css(:root {
  color-scheme: light dark;
  --ground: #ffffff; --panel: #f3f5f8; --line: #c9d0d9; --text: #1b222c; --faint: #566070;
  --accent: #1257a8; --bar: #1c6dd0; --warn-ground: #fff3d6; --warn: #6b4700;
}
@media (prefers-color-scheme: dark) {
  :root {
    --ground: #14181e; --panel: #1d232c; --line: #3a4453; --text: #e6eaf0; --faint: #a3adbb;
    --accent: #8abaff; --bar: #5d9df0; --warn-ground: #3a2e10; --warn: #ffd98a;
  }
}
* { box-sizing: border-box; }
body { margin: 0; background: var(--ground); color: var(--text);
  font: 1rem/1.45 system-ui, sans-serif; }
a { color: var(--accent); }
a:focus-visible, :focus-visible { outline: 3px solid var(--accent); outline-offset: 2px; }
.skip { position: absolute; left: -999px; }
.skip:focus { left: 0.5rem; top: 0.5rem; background: var(--ground); padding: 0.3rem; z-index: 1; }
header { display: flex; flex-wrap: wrap; gap: 0.4rem 1.4rem; align-items: baseline;
  padding: 0.6rem 1rem; background: var(--panel); border-bottom: 1px solid var(--line); }
header nav a { display: inline-block; margin-right: 0.9rem; padding: 0.2rem 0; }
#state { margin: 0 0 0 auto; color: var(--faint); font-size: 0.9rem; min-height: 1.3em; }
#state.bad { color: var(--warn); background: var(--warn-ground); padding: 0 0.5rem; }
main { max-width: 84rem; margin: 0 auto; padding: 0.5rem 1rem 3rem; }
main:focus { outline: none; }
h1 { font-size: 1.5rem; margin: 0.6rem 0; overflow-wrap: anywhere; }
h2 { font-size: 1.15rem; margin: 1.6rem 0 0.4rem; }
h3 { font-size: 1rem; margin: 1.1rem 0 0.3rem; }
td.words { min-width: 6rem; }
.note { color: var(--faint); margin: 0.3rem 0; }
.notes { background: var(--warn-ground); color: var(--warn); padding: 0.5rem 0.5rem 0.5rem 1.6rem;
  border-radius: 4px; overflow-wrap: anywhere; }
.notes a { color: inherit; }
.scroll { overflow-x: auto; max-width: 100%; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: 0.25rem 0.7rem; text-align: right; border-bottom: 1px solid var(--line);
  white-space: nowrap; }
tbody th { font-weight: normal; }
tbody th[scope="row"] { text-align: left; }
.list td.words { white-space: nowrap; min-width: 0; }
thead th { color: var(--faint); font-weight: 600; vertical-align: bottom; }
.long { display: inline-block; white-space: normal; min-width: 16rem; max-width: 46rem;
  overflow-wrap: anywhere; }
progress { width: 8rem; height: 0.8rem; accent-color: var(--bar); vertical-align: middle; }
.large progress { width: min(28rem, 60vw); height: 1.1rem; }
dl { display: grid; grid-template-columns: repeat(auto-fit, minmax(9rem, 1fr)); gap: 0.6rem;
  margin: 0.8rem 0; }
dl div { background: var(--panel); border-radius: 4px; padding: 0.4rem 0.7rem; }
dt { color: var(--faint); font-size: 0.85rem; }
dd { margin: 0; font-size: 1.15rem; font-variant-numeric: tabular-nums; overflow-wrap: anywhere; }
form { display: flex; flex-wrap: wrap; gap: 0.5rem 0.8rem; align-items: center; margin: 0.6rem 0; }
input, select, button { font: inherit; color: inherit; background: var(--ground);
  border: 1px solid var(--faint); border-radius: 4px; padding: 0.25rem 0.5rem; max-width: 100%; }
.pages a, .pages span { display: inline-block; padding: 0.25rem 0.5rem; }
.pages .off { color: var(--faint); }
.attempts svg { display: block; height: auto; width: 100%; min-width: 56rem; max-width: 75rem; }
@media (max-width: 34rem) {
  main { padding: 0.3rem 0.6rem 2rem; }
  th, td { padding: 0.25rem 0.45rem; }
  header { padding: 0.5rem 0.6rem; }
}
)css";

// The new markup is merged into the old element by element, so that focus, scroll positions and
// selected text stay.
constexpr std::string_view script = R"js('use strict';
(() => {
  const live = document.getElementById('live');
  const state = document.getElementById('state');
  const interval = 2000;
  let timer = 0;
  let failing = false;

  const say = (text, isBad) => {
    if (state.textContent !== text) state.textContent = text;
    state.classList.toggle('bad', isBad);
  };

  const mergeAttributes = (old, fresh) => {
    for (const { name } of [...old.attributes]) {
      if (!fresh.hasAttribute(name)) old.removeAttribute(name);
    }
    for (const { name, value } of fresh.attributes) {
      if (old.getAttribute(name) !== value) old.setAttribute(name, value);
    }
  };

  const isAlike = (old, fresh) => old.nodeName === fresh.nodeName &&
    old.className === fresh.className;

  // Notes come and go before a table: what has the focus is never removed to make room for them.
  const merge = (old, fresh) => {
    let there = old.firstChild;
    for (const node of fresh.childNodes) {
      let match = there;
      while (match && !isAlike(match, node)) {
        match = match.contains(document.activeElement) ? null : match.nextSibling;
      }
      if (!match) {
        old.insertBefore(document.importNode(node, true), there);
        continue;
      }
      while (there !== match) {
        there = there.nextSibling;
        there.previousSibling.remove();
      }
      there = match.nextSibling;
      if (node.nodeType === Node.ELEMENT_NODE) {
        mergeAttributes(match, node);
        merge(match, node);
      } else if (match.data !== node.data) {
        match.data = node.data;
      }
    }
    while (there) {
      const next = there.nextSibling;
      there.remove();
      there = next;
    }
  };

  const refresh = async () => {
    const address = new URL(location.href);
    address.hash = '';
    address.searchParams.set('fragment', '1');
    try {
      const signal = AbortSignal.timeout(10000);
      const answer = await fetch(address, { cache: 'no-store', signal });
      if (answer.status === 401) {
        say('The token is not valid any more.', true);
        return;
      }
      if (!answer.ok) throw new Error(String(answer.status));
      const fresh = new DOMParser().parseFromString(await answer.text(), 'text/html');
      merge(live, fresh.body);
      if (failing) say('Connected again.', false);
      failing = false;
    } catch (error) {
      if (!failing) {
        const time = new Date().toLocaleTimeString();
        say('The coordinator cannot be reached since ' + time + '; trying again.', true);
      }
      failing = true;
    }
    schedule();
  };

  const schedule = () => {
    clearTimeout(timer);
    if (!document.hidden) timer = setTimeout(refresh, interval);
  };

  document.addEventListener('visibilitychange', () => {
    clearTimeout(timer);
    if (!document.hidden) refresh();
  });
  schedule();
})();
)js";

}  // namespace

std::string page_style() { return review_style() + std::string(style); }

std::string_view page_script() { return script; }

}  // namespace proofmass::coordinator
