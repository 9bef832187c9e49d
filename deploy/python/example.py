#!/usr/bin/env python3
# %% [markdown]
# # A campaign in Python
# The cells of this script run in order in an editor that knows `# %%`, or all at once:
#
#     python3 example.py hardy2013.db figures
#
# It reads the database that `./deploy/quickstart.sh` makes, prints the accuracy of each parameter
# and writes three figures.

# %%
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")  # Figures go to files.
import matplotlib.pyplot as pyplot
import numpy

import proofmass

file, directory = (sys.argv[1:] + ["hardy2013.db", "figures"][len(sys.argv) - 1:])[:2]
directory = pathlib.Path(directory)
directory.mkdir(parents=True, exist_ok=True)

# %% [markdown]
# ## What was run

# %%
campaign = proofmass.open(file)
print(f"{campaign.name}, seed {campaign.seed}, {campaign.num_runs} runs, "
      f"model {campaign.model_version}")
print(f"digest {campaign.digest}")

# %% [markdown]
# ## How accurate the calibration is
# `results()` has a row a run. `error` is estimate − truth, in the unit of the quantity.

# %%
results = campaign.results()
is_completed = numpy.asarray(results["status"]) == "completed"
magnitudes = {quantity.name: numpy.abs(numpy.asarray(results[quantity.error])[is_completed])
              for quantity in campaign.quantities}
for quantity in campaign.quantities:
    magnitude = magnitudes[quantity.name]
    print(f"{quantity.symbol:10} worst {magnitude.max():10.3g}  mean {magnitude.mean():10.3g}  "
          f"std {magnitude.std(ddof=1):10.3g}  {quantity.unit}")

# %% [markdown]
# ## Errors beside their objectives

# %%
num_columns = min(5, len(campaign.quantities))
num_rows = -(-len(campaign.quantities) // num_columns)
figure, axes = pyplot.subplots(num_rows, num_columns, figsize=(3 * num_columns, 2.5 * num_rows),
                               squeeze=False, layout="constrained")
for axis in axes.flat[len(campaign.quantities):]:
    axis.set_axis_off()
for axis, quantity in zip(axes.flat, campaign.quantities):
    axis.hist(magnitudes[quantity.name], bins="auto", color="tab:blue")
    if quantity.objective is not None:
        axis.axvline(quantity.objective, color="tab:orange", linestyle="--")
    axis.set_title(quantity.symbol)
    axis.set_xlabel(f"|error|, {quantity.unit}")
figure.suptitle("Errors (bars) and objectives (dashed lines)")
figure.savefig(directory / "errors.png")

# %% [markdown]
# ## How the mean error settles as runs are added

# %%
figure, axis = pyplot.subplots(figsize=(7, 4), layout="constrained")
for quantity in campaign.quantities:
    magnitude = magnitudes[quantity.name]
    count = numpy.arange(1, len(magnitude) + 1)
    axis.plot(count, numpy.cumsum(magnitude) / count / magnitude.mean(), label=quantity.symbol)
axis.set_xscale("log")
axis.set_xlabel("runs")
axis.set_ylabel("mean |error| of so many runs / of all")
axis.legend(fontsize="small", ncols=2)
figure.savefig(directory / "convergence.png")

# %% [markdown]
# ## Does an error depend on a truth?
# The correlation of each error with each true value. A large one hints at a systematic error.
# `proofmass sensitivity` also looks at products of two.

# %%
errors = numpy.array([numpy.asarray(results[quantity.error])[is_completed]
                      for quantity in campaign.quantities])
truths = numpy.array([numpy.asarray(results[quantity.truth])[is_completed]
                      for quantity in campaign.quantities])
count = len(campaign.quantities)
correlation = numpy.corrcoef(errors, truths)[:count, count:]
symbols = [quantity.symbol for quantity in campaign.quantities]
figure, axis = pyplot.subplots(figsize=(7, 6), layout="constrained")
image = axis.imshow(correlation, cmap="PuOr", vmin=-1, vmax=1)
axis.set_xticks(range(count), symbols, rotation=90)
axis.set_yticks(range(count), symbols)
axis.set_xlabel("truth of")
axis.set_ylabel("error of")
figure.colorbar(image, label="correlation")
figure.savefig(directory / "correlation.png")

print(f"wrote {', '.join(sorted(path.name for path in directory.glob('*.png')))} to {directory}")
