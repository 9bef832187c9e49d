// Drives pages in a headless Chromium, for page_check.py.
//
// Usage: node page_check.mjs ORDER.json, where playwright-core and axe-core are installed in the
// present directory. The order has `chromium`, `screenshots` (a directory) and `pages`: a list of
// {name, url, wait_for (a selector), numbers ({selector: text}), cells ([{row, column, text}]: of
// the table that has such a row and column), live (a selector whose text must change by itself),
// final_url}. Each page is opened in both themes, 1400 and 400 pixels wide. `end` has a url, the
// number of a process that is ended, and what the page says then.
//
// Prints a line of JSON: a list of findings, empty if all is well.

import { createRequire } from 'node:module';
import { readFileSync } from 'node:fs';
import path from 'node:path';

const require = createRequire(path.join(process.cwd(), 'here.js'));
const { chromium } = require('playwright-core');
const axe = readFileSync(require.resolve('axe-core/axe.min.js'), 'utf8');
const order = JSON.parse(readFileSync(process.argv[2], 'utf8'));
const findings = [];

async function checkAccessibility(page, where) {
  // The page's own rules forbid foreign scripts; this one comes through the debugger.
  const session = await page.context().newCDPSession(page);
  await session.send('Runtime.evaluate', { expression: axe });
  const { result } = await session.send('Runtime.evaluate', {
    expression: 'axe.run().then((r) => JSON.stringify(r.violations))',
    awaitPromise: true, returnByValue: true,
  });
  for (const violation of JSON.parse(result.value)) {
    if (!['serious', 'critical'].includes(violation.impact)) continue;
    const targets = violation.nodes.map((node) => node.target.join(' ')).slice(0, 3).join(', ');
    findings.push(`${where}: accessibility: ${violation.id}: ${violation.help}: ${targets}`);
  }
}

async function checkNumbers(page, item, where) {
  for (const [selector, expected] of Object.entries(item.numbers ?? {})) {
    const text = (await page.locator(selector).first().textContent())?.trim();
    if (text !== expected) {
      findings.push(`${where}: ${selector} = ${text} (must be ${expected})`);
    }
  }
}

async function checkCells(page, item, where) {
  for (const { row, column, text } of item.cells ?? []) {
    const shown = await page.evaluate(([rowName, columnName]) => {
      for (const table of document.querySelectorAll('table')) {
        const headers = [...table.querySelectorAll('thead tr:last-child th')];
        const place = headers.findIndex((cell) => cell.textContent.trim() === columnName);
        const line = [...table.querySelectorAll('tbody tr')].find(
          (candidate) => candidate.children[0].textContent.trim() === rowName);
        if (place >= 0 && line) return line.children[place].textContent.trim();
      }
      return null;
    }, [row, column]);
    if (shown !== text) findings.push(`${where}: ${row} ${column} = ${shown} (must be ${text})`);
  }
}

async function checkLayout(page, where) {
  const [content, window] = await page.evaluate(
    () => [document.documentElement.scrollWidth, document.documentElement.clientWidth]);
  if (content > window) findings.push(`${where}: is ${content} wide in a window of ${window}`);
}

// The focus must stay where it is when the page changes by itself.
async function checkLife(page, item, where) {
  const before = await page.locator(item.live).first().textContent();
  await page.locator('#live .scroll').first().focus();
  await page.waitForFunction(
    ([selector, text]) => document.querySelector(selector)?.textContent !== text,
    [item.live, before], { timeout: 30000 });
  const hasFocus = await page.evaluate(() => document.activeElement?.classList.contains('scroll'));
  if (!hasFocus) findings.push(`${where}: the focus is lost when the page changes`);
}

async function checkPage(browser, item, theme, width) {
  const where = `${item.name} ${theme} ${width}`;
  const context = await browser.newContext({
    colorScheme: theme, viewport: { width, height: 900 }, extraHTTPHeaders: item.headers ?? {},
  });
  const page = await context.newPage();
  page.on('console', (message) => {
    if (message.type() === 'error' || message.type() === 'warning') {
      findings.push(`${where}: console: ${message.text()}`);
    }
  });
  page.on('pageerror', (error) => findings.push(`${where}: error: ${error.message}`));
  page.on('dialog', (dialog) => {
    findings.push(`${where}: dialog: ${dialog.message()}`);
    dialog.dismiss();
  });
  const origin = new URL(item.url).origin;
  page.on('request', (request) => {
    const url = request.url();
    if (url.startsWith('data:') || url === item.url) return;
    if (origin === 'null' || new URL(url).origin !== origin) {
      findings.push(`${where}: request to ${url}`);
    }
  });
  await page.goto(item.url);
  await page.waitForSelector(item.wait_for, { timeout: 60000, state: 'attached' });
  await checkNumbers(page, item, where);
  await checkCells(page, item, where);
  if (item.final_url && page.url() !== item.final_url) {
    findings.push(`${where}: ends at ${page.url()} (must be ${item.final_url})`);
  }
  await checkAccessibility(page, where);
  await checkLayout(page, where);
  await page.screenshot({
    path: path.join(order.screenshots, `${item.name}-${theme}-${width}.png`), fullPage: true,
  });
  if (item.live && theme === 'light' && width === 1400) await checkLife(page, item, where);
  await context.close();
}

async function checkEnd(browser, { url, process_id: processId, text }) {
  const page = await browser.newPage();
  await page.goto(url);
  process.kill(processId, 'SIGTERM');
  await page.waitForSelector('#state.bad', { timeout: 30000 });
  const shown = await page.locator('#state').textContent();
  if (!shown.startsWith(text)) findings.push(`end: ${shown} (must begin with ${text})`);
  await page.close();
}

const browser = await chromium.launch({
  executablePath: order.chromium, args: ['--no-sandbox', '--disable-gpu'],
});
try {
  for (const item of order.pages) {
    for (const theme of ['light', 'dark']) {
      for (const width of [1400, 400]) await checkPage(browser, item, theme, width);
    }
  }
  if (order.end) await checkEnd(browser, order.end);
} finally {
  await browser.close();
}
console.log(JSON.stringify(findings));
