#include <string>

#include "coordinator/page/page_views.hpp"
#include "coordinator/report/report.hpp"

namespace proofmass::coordinator {
namespace {

// Beside review_style(). The colours have a contrast of 4.5 at least, in both themes.
constexpr std::string_view style = R"css(
header { display: flex; flex-wrap: wrap; gap: 0.4rem 1.4rem; align-items: baseline;
  padding: 0.6rem 1rem; background: var(--heading); border-bottom: 1px solid var(--chart-grid); }
header nav a { display: inline-block; margin-right: 0.9rem; padding: 0.2rem 0; }
#state { margin: 0 0 0 auto; color: var(--faint); font-size: 0.9rem; min-height: 1.3em; }
#state.bad { color: var(--open); background: var(--warn-ground); padding: 0 0.5rem; }
main { max-width: 84rem; margin: 0 auto; padding: 0.5rem 1rem 3rem; }
main:focus { outline: none; }
h2 { font-size: 1.15rem; margin: 1.6rem 0 0.4rem; }
.note { color: var(--faint); }
.notes { background: var(--warn-ground); color: var(--open); border-radius: 4px;
  padding: 0.5rem 0.5rem 0.5rem 1.6rem; overflow-wrap: anywhere; }
.list td, thead th { white-space: nowrap; min-width: 0; }
.list tbody th { min-width: 9rem; }
thead th { color: var(--faint); }
.long { display: inline-block; white-space: normal; min-width: 16rem; max-width: 46rem;
  overflow-wrap: anywhere; }
progress { width: min(8rem, 12vw); height: 0.8rem; accent-color: var(--chart-first); vertical-align: middle; }
.large progress { width: min(28rem, 60vw); height: 1.1rem; }
dl { display: grid; grid-template-columns: repeat(auto-fit, minmax(9rem, 1fr)); gap: 0.6rem;
  margin: 0.8rem 0; }
dl div { background: var(--heading); border-radius: 4px; padding: 0.4rem 0.7rem; }
dt { color: var(--faint); font-size: 0.85rem; }
dd { margin: 0; font-size: 1.15rem; font-variant-numeric: tabular-nums; overflow-wrap: anywhere; }
form { display: flex; flex-wrap: wrap; gap: 0.5rem 0.8rem; align-items: center; margin: 0.6rem 0; }
input, select, button { font: inherit; color: inherit; background: var(--chart-ground);
  border: 1px solid var(--faint); border-radius: 4px; padding: 0.25rem 0.5rem; max-width: 100%; }
.pages a, .pages span { display: inline-block; padding: 0.25rem 0.5rem; }
.pages .off { color: var(--faint); }
.attempts svg { display: block; height: auto; width: 100%; min-width: 56rem; max-width: 75rem; }
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
