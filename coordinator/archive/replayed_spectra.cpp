#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>

#include "coordinator/archive/replay.hpp"
#include "coordinator/report/report.hpp"
#include "core/math/elementary.hpp"
#include "core/signal/band_pass.hpp"
#include "core/signal/line_weights.hpp"
#include "core/signal/periodogram.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t num_bands_of_decade = 24;
constexpr std::size_t first_bin = 3;  ///< Those below hold what the window leaves of the mean.
constexpr std::size_t num_bins_of_line = 2;  ///< On each side.

/// A line of a signal before any filter: cosine · cos 2πft + sine · sin 2πft.
struct FittedLine {
  double frequency_hz = 0.0;
  double cosine = 0.0;
  double sine = 0.0;
};

/// A fit gives the phasors behind its band-pass; the filter's response leads back to the signal.
void append_lines_of(const LineFit& fit, const std::vector<double>& record,
                     std::vector<FittedLine>& lines) {
  const LineWeights weights(fit);
  WeightReader reader(weights);
  const std::size_t num_outputs = 2 * weights.num_fit_lines();
  std::vector<double> buffer(LineWeights::block_size * num_outputs);
  std::vector<double> sums(num_outputs, 0.0);
  std::size_t sample = 0;
  for (std::size_t block = 0; block < weights.num_blocks(); ++block) {
    reader.fill_block(block, buffer);
    for (std::size_t k = 0; k < weights.samples_in(block); ++k, ++sample) {
      for (std::size_t i = 0; i < num_outputs; ++i) {
        sums[i] += buffer[k * num_outputs + i] * record[sample];
      }
    }
  }
  for (std::size_t i = 0; i < fit.fit_hz.size(); ++i) {
    const std::complex<double> before = std::complex<double>(sums[2 * i], -sums[2 * i + 1]) /
                                        response(fit.filter, fit.fit_hz[i], fit.sample_period_s);
    lines.push_back({fit.fit_hz[i], before.real(), -before.imag()});
  }
}

std::vector<double> without_lines(const std::vector<double>& record, double sample_period_s,
                                  const std::vector<FittedLine>& lines) {
  std::vector<double> residual = record;
  for (const FittedLine& line : lines) {
    for (std::size_t k = 0; k < residual.size(); ++k) {
      const auto [sine, cosine] =
          sincos_turns(line.frequency_hz * sample_period_s * static_cast<double>(k));
      residual[k] -= line.cosine * cosine + line.sine * sine;
    }
  }
  return residual;
}

/// Spectra of a session bin by bin, and which bins are about a line.
struct BinnedSpectrum {
  Periodogram measured;
  Periodogram residual;
  std::vector<bool> is_of_line;

  [[nodiscard]] std::size_t size() const { return measured.psd.size(); }
  [[nodiscard]] double frequency_hz(std::size_t bin) const {
    return static_cast<double>(bin) / measured.duration_s;
  }
};

std::vector<bool> bins_of_lines(const std::vector<FittedLine>& lines,
                                const Periodogram& periodogram) {
  std::vector<bool> is_of_line(periodogram.psd.size(), false);
  for (const FittedLine& line : lines) {
    const auto centre =
        static_cast<std::size_t>(std::lround(line.frequency_hz * periodogram.duration_s));
    const std::size_t begin = centre - std::min(centre, num_bins_of_line);
    for (std::size_t bin = begin; bin <= centre + num_bins_of_line; ++bin) {
      if (bin < is_of_line.size()) is_of_line[bin] = true;
    }
  }
  return is_of_line;
}

/// Of the bins [begin, end).
SpectrumPoint point_of(const BinnedSpectrum& spectrum, const ExpectedSpectrum& expected,
                       std::size_t begin, std::size_t end) {
  SpectrumPoint sum;
  for (std::size_t bin = begin; bin < end; ++bin) {
    const double frequency_hz = spectrum.frequency_hz(bin);
    sum.frequency_hz += std::log(frequency_hz);
    sum.measured += spectrum.measured.psd[bin];
    sum.residual += spectrum.residual.psd[bin];
    sum.expected += expected.noise_psd(frequency_hz);
  }
  const auto count = static_cast<double>(end - begin);
  return {.frequency_hz = std::exp(sum.frequency_hz / count),
          .measured = std::sqrt(sum.measured / count),
          .residual = std::sqrt(sum.residual / count),
          .expected = std::sqrt(sum.expected / count)};
}

std::vector<SpectrumPoint> points_of(const BinnedSpectrum& spectrum,
                                     const ExpectedSpectrum& expected) {
  std::vector<SpectrumPoint> points;
  const double step = std::pow(10.0, 1.0 / num_bands_of_decade);
  std::size_t begin = first_bin;
  while (begin < spectrum.size()) {
    const auto wide = static_cast<std::size_t>(static_cast<double>(begin) * step);
    const std::size_t end_of_band = std::min(std::max(wide, begin + 1), spectrum.size());
    std::size_t end = begin + 1;
    while (!spectrum.is_of_line[begin] && end < end_of_band && !spectrum.is_of_line[end]) ++end;
    points.push_back(point_of(spectrum, expected, begin, end));
    begin = end;
  }
  return points;
}

/// A bin over its mean has an exponential distribution, whose median is ln 2. The median hardly
/// sees lines that the session does not fit, of which each has three bins: of few bins there is
/// none to tell.
std::optional<NoiseRatio> noise_ratio_of(const BinnedSpectrum& spectrum,
                                         const ExpectedSpectrum& expected) {
  const std::vector<double>& used_hz = expected.fits.front().fit_hz;
  const double from_hz = std::ranges::min(used_hz) / 3.0;
  const double to_hz = std::ranges::max(used_hz) * 3.0;
  constexpr std::size_t num_bins_min = 16;
  std::vector<double> ratios;
  for (std::size_t bin = first_bin; bin < spectrum.size(); ++bin) {
    const double frequency_hz = spectrum.frequency_hz(bin);
    if (frequency_hz < from_hz || frequency_hz > to_hz || spectrum.is_of_line[bin]) continue;
    const double noise_psd = expected.noise_psd(frequency_hz);
    if (!(noise_psd > 0.0)) return std::nullopt;
    ratios.push_back(spectrum.residual.psd[bin] / noise_psd);
  }
  if (ratios.size() < num_bins_min) return std::nullopt;
  const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
  std::ranges::nth_element(ratios, middle);
  // Of independent bins 1/(ln 2 √n). What the window correlates, neighbours by 4/9 and the next but
  // one by 1/36, adds to the variance of a mean 2(4/9 + 1/36), to that of a median less.
  constexpr double correlation = 1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0);
  const double ratio = *middle / std::numbers::ln2;
  return NoiseRatio{ratio, ratio * std::sqrt(correlation / static_cast<double>(ratios.size())) /
                               std::numbers::ln2};
}

/// @param spectrum  Gets points, lines and ratio.
void fill_spectrum(const std::vector<double>& record, const ExpectedSpectrum& expected,
                   SessionSpectrum& spectrum) {
  const double period_s = expected.fits.front().sample_period_s;
  std::vector<FittedLine> lines;
  for (const LineFit& fit : expected.fits) append_lines_of(fit, record, lines);
  BinnedSpectrum binned{
      .measured = hann_periodogram(record, period_s),
      .residual = hann_periodogram(without_lines(record, period_s, lines), period_s),
      .is_of_line = {}};
  binned.is_of_line = bins_of_lines(lines, binned.measured);
  spectrum.points = points_of(binned, expected);
  spectrum.noise_ratio = noise_ratio_of(binned, expected);
  const std::size_t num_used = expected.fits.front().fit_hz.size();
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const double amplitude = std::hypot(lines[i].cosine, lines[i].sine);
    spectrum.lines.push_back({.frequency_hz = lines[i].frequency_hz,
                              .amplitude = amplitude,
                              .height = amplitude * std::sqrt(binned.measured.duration_s / 3.0),
                              .is_used = i < num_used});
  }
}

/// Collects the signals of a replay, session by session, and computes their spectra.
class SpectraOutput final : public SeriesOutput {
 public:
  explicit SpectraOutput(const Recording& recording) : recording_(recording) {}

  void add(const RecordedSample& sample) override {
    if (next_ == recording_.spectra.size()) return;
    if (sample.session > recording_.spectra[next_].session) end_spectrum();
    if (next_ == recording_.spectra.size()) return;
    const ExpectedSpectrum& expected = recording_.spectra[next_];
    if (sample.session == expected.session && !is_too_long(expected)) {
      record_.push_back(sample.values[expected.value]);
    }
  }
  void finish() override {
    while (next_ < recording_.spectra.size()) end_spectrum();
  }

  [[nodiscard]] RunSpectra take() { return std::move(spectra_); }

 private:
  [[nodiscard]] static bool is_too_long(const ExpectedSpectrum& expected) {
    return expected.fits.front().num_samples > num_spectrum_samples_max;
  }

  void end_spectrum() {
    const ExpectedSpectrum& expected = recording_.spectra[next_++];
    const std::string& session = recording_.sessions[expected.session].name;
    if (is_too_long(expected)) {
      spectra_.reasons.push_back(
          fmt::format("Session {} has {} samples, and spectra are computed of {} at most.", session,
                      expected.fits.front().num_samples, num_spectrum_samples_max));
      return;
    }
    const RecordedSignal& signal = signal_of(expected.value);
    SessionSpectrum& spectrum = spectra_.sessions.emplace_back();
    spectrum.session = session;
    spectrum.meaning = signal.meaning;
    spectrum.unit = signal.unit;
    spectrum.noise_meaning = expected.noise_meaning;
    fill_spectrum(std::exchange(record_, {}), expected, spectrum);
  }

  [[nodiscard]] const RecordedSignal& signal_of(std::size_t value) const {
    std::size_t group = 0;
    while (value >= recording_.groups[group].signals.size()) {
      value -= recording_.groups[group++].signals.size();
    }
    return recording_.groups[group].signals[value];
  }

  const Recording& recording_;
  RunSpectra spectra_;
  std::size_t next_ = 0;  ///< Of Recording::spectra.
  std::vector<double> record_;
};

RunSpectra none_of(RunIndex run, std::string reason) {
  return {.run = run, .sessions = {}, .reasons = {std::move(reason)}};
}

}  // namespace

RunSpectra replayed_spectra(const Replay& replay, RunIndex run, const HeedStop& heed_stop) {
  const RunResult stored = replay.stored_result(run);
  if (replay.recording().spectra.empty()) return none_of(run, "The model describes no spectrum.");
  SpectraOutput output(replay.recording());
  const std::vector<ResultDifference> differences = replay.run(stored, &output, heed_stop);
  if (const std::size_t count = differences.size(); count > 0) {
    return none_of(run, fmt::format("A replay of run {} does not give the stored result: {} of its "
                                    "values {}. proofmass verify tells more.",
                                    run.value, count, count == 1 ? "differs" : "differ"));
  }
  RunSpectra spectra = output.take();
  spectra.run = run;
  return spectra;
}

std::optional<RunSpectra> worst_run_spectra(const Store& store, const Review& review,
                                            const HeedStop& heed_stop) {
  if (review.is_of_program) return std::nullopt;
  const std::optional<RunIndex> worst = worst_run_of(review);
  if (!worst) return none_of({}, "No run has an estimate, or no quantity an objective.");
  try {
    return replayed_spectra(Replay(store), *worst, heed_stop);
  } catch (const ArchiveError& error) {
    return none_of(*worst,
                   fmt::format("Run {} cannot be replayed: {}.", worst->value, error.what()));
  }
}

std::vector<std::string> spectrum_names(const Recording& recording) {
  std::vector<std::string> names;
  for (const ExpectedSpectrum& expected : recording.spectra) {
    names.push_back(spectrum_name(recording.sessions[expected.session].name));
  }
  return names;
}

}  // namespace proofmass::coordinator
