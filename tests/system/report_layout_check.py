#!/usr/bin/env python3
"""Looks at the HTML report in a real browser, in windows 1400 and 400 pixels wide.

    report_layout_check.py --programs build/release/bin

Nothing is wider than the window; at 1400 pixels no table has to be scrolled, so that the last column of
the verification matrix is seen; all charts have one size of text; no text of a chart lies over another
or, being a label of a limit, over a bar; each sentence at the top leads to a section. Parameters and
numbers have one spelling. Ends with 77 if chromium is not installed, unless CI is set.
"""

import html
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import checking

MEASURE = """
const problems = [];
const isOver = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 &&
  Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 4;
for (const frame of document.querySelectorAll('iframe')) {
  const page = frame.contentDocument;
  const width = frame.clientWidth;
  const tell = (text) => problems.push(`${width}: ${text}`);
  if (page.documentElement.scrollWidth > width) tell(`is ${page.documentElement.scrollWidth} wide`);
  const sizes = new Set();
  for (const svg of page.querySelectorAll('svg')) {
    const name = svg.querySelector('title').textContent;
    const scale = svg.getBoundingClientRect().width / svg.viewBox.baseVal.width;
    const isScrolled = svg.closest('.scroll') !== null && width < 1000;
    const texts = [...svg.querySelectorAll('text')];
    if (!isScrolled) {
      for (const text of texts) sizes.add((scale * parseFloat(getComputedStyle(text).fontSize)).toFixed(1));
    }
    const upright = texts.filter((text) => !text.hasAttribute('transform'));
    const boxes = upright.map((text) => text.getBoundingClientRect());
    for (let i = 0; i < boxes.length; ++i) {
      for (let j = 0; j < i; ++j) {
        if (isOver(boxes[i], boxes[j])) {
          tell(`${name}: ${upright[i].textContent} over ${upright[j].textContent}`);
        }
      }
      if (boxes[i].right > svg.getBoundingClientRect().right + 1) tell(`${name}: ${upright[i].textContent} is cut`);
    }
    const bars = [...svg.querySelectorAll('g rect')].map((bar) => bar.getBoundingClientRect());
    upright.forEach((text, i) => {
      const { left, right, top, bottom } = boxes[i];
      const box = { left, right, top, bottom: bottom + 7 };  // Its letters need some ground.
      if (/^(bias|objective)/.test(text.textContent) && bars.some((bar) => isOver(box, bar))) {
        tell(`${name}: ${text.textContent} touches a bar`);
      }
    });
  }
  if (sizes.size !== 1) tell(`text sizes in charts = ${[...sizes].join(', ')} (must be one)`);
  for (const box of page.querySelectorAll('.scroll')) {
    if (width === 1400 && box.scrollWidth > box.clientWidth) {
      tell(`${box.textContent.trim().split('\\n')[0]} is ${box.scrollWidth} wide in ${box.clientWidth}`);
    }
  }
  for (const heading of page.querySelectorAll('tbody th')) {
    const words = heading.textContent.split(/\\s+/);
    const range = page.createRange();
    range.selectNodeContents(heading);
    const lines = new Set([...range.getClientRects()].map((line) => Math.round(line.top)));
    if (lines.size > words.length && words.every((word) => word.length < 13)) {
      tell(`${heading.textContent} is broken`);
    }
  }
  for (const verdict of page.querySelectorAll('#matrix td strong')) {
    if (verdict.getBoundingClientRect().right > width) tell(`${verdict.textContent} is not in sight`);
  }
  const links = [...page.querySelectorAll('#summary li a')];
  if (links.length !== 5) tell(`sentences = ${links.length} (must be 5)`);
  for (const link of links) {
    if (!page.querySelector(link.getAttribute('href'))) tell(`${link.textContent} leads nowhere`);
  }
}
const pre = document.createElement('pre');
pre.id = 'problems';
pre.textContent = JSON.stringify(problems);
document.body.append(pre);
"""


def write_report(programs, folder):
    checking.write_short_campaign(programs, folder, runs=64)
    subprocess.run([programs / "proofmass", "run", folder / "short.toml", "--quiet", "--db",
                    folder / "short.db"], check=True, stdout=subprocess.DEVNULL)
    return subprocess.run([programs / "proofmass", "report", folder / "short.db", "--html", "-"],
                          check=True, stdout=subprocess.PIPE, text=True).stdout


def spelling_problems(report):
    shown = html.unescape(re.sub(r"<style>.*?</style>|<code>.*?</code>|<[^>]*>", " ", report,
                                 flags=re.DOTALL))
    forms = {"a parameter by its name in files": r"\b(?:truth_\w+|a_c11_delta_[xyz]|a_d11_prime|k2[cd])\b",
             "a number as programs write it": r"\b\d(?:\.\d+)?e[-+]?\d+\b",
             "a number with another multiplication sign": r"\d × 1",
             "a minus sign for programs": r"(?<![\w.:-])-\d"}
    return [f"{what}: {found}" for what, form in forms.items()
            for found in sorted(set(re.findall(form, shown)))]


def layout_problems(report, folder, chromium):
    frames = "".join(f'<iframe style="border:0;width:{width}px;height:900px" srcdoc="{html.escape(report)}">'
                     "</iframe>" for width in (1400, 400))
    page = folder / "frames.html"
    page.write_text("<!DOCTYPE html><meta charset=utf-8><body>" + frames +
                    f"<script>onload = () => {{{MEASURE}}}</script></body>")
    done = subprocess.run(
        [chromium, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-quic",
         "--disable-background-networking", "--disable-component-update", "--disable-sync",
         f"--user-data-dir={folder}/browser", "--window-size=1900,1000", "--dump-dom", page.as_uri()],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=300)
    found = re.search(r'<pre id="problems">(.*?)</pre>', done.stdout, re.DOTALL)
    if not found:
        return ["chromium: " + done.stderr[-2000:]]
    return json.loads(html.unescape(found.group(1)))


def main():
    parser = checking.parser_of(__doc__)
    parser.add_argument("--report", type=pathlib.Path, help="look at this one instead")
    arguments = parser.parse_args()
    chromium = shutil.which("chromium")
    if not chromium:
        checking.skip("needs chromium")
    with tempfile.TemporaryDirectory(prefix="report_layout_check.") as name:
        folder = pathlib.Path(name)
        report = (arguments.report.read_text() if arguments.report
                  else write_report(arguments.programs.resolve(), folder))
        problems = spelling_problems(report) + layout_problems(report, folder, chromium)
    print("\n".join(problems) if problems else "report_layout_check: all is well")
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
