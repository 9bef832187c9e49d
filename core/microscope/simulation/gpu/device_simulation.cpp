#include "core/microscope/simulation/gpu/device_simulation.hpp"

#include <algorithm>
#include <array>
#include <functional>
#include <numeric>
#include <utility>

#include "core/error.hpp"
#include "core/microscope/simulation/loop.hpp"

namespace proofmass::gpu {
namespace {

static_assert(DeviceSimulation::group_size == group_lanes);

constexpr std::size_t launch_samples_max = 2048;
constexpr std::size_t fast_bytes =
    num_words<LoopConstants<double>> * group_lanes * sizeof(std::uint64_t);

template <typename T>
T* allocate(Device& device, std::size_t count) {
  return static_cast<T*>(device.allocate(count * sizeof(T)));
}

template <typename T>
const T* upload(Device& device, const std::vector<T>& values) {
  T* const address = allocate<T>(device, values.size());
  device.copy_in(address, std::as_bytes(std::span(values)));
  return address;
}

/// All samples of a session, settling included.
std::vector<SharedSample> all_samples(SessionSignals signals) {
  std::vector<SharedSample> samples(
      static_cast<std::size_t>(signals.num_settling() + signals.num_record()));
  for (SharedSample& sample : samples) sample = signals.next();
  return samples;
}

/// All weights of a record, sample after sample, with room for a whole last block.
std::vector<double> all_weights(const LineWeights& weights) {
  const std::size_t block_outputs = LineWeights::block_size * 2 * weights.num_fit_lines();
  std::vector<double> all(weights.num_blocks() * block_outputs);
  WeightReader reader(weights);
  for (std::size_t block = 0; block < weights.num_blocks(); ++block) {
    reader.fill_block(block, std::span(all).subspan(block * block_outputs, block_outputs));
  }
  return all;
}

/// Whether both sensors have the same noise: the kernels have one filter for both.
bool are_alike(const NoiseConfig& noise) {
  return noise.wire.damping_n_m == 0.0 && noise.linear_factor[0] == noise.linear_factor[1];
}

/// The mark of a launch's loops. The last one but one has the same, and wrote over the noise that
/// those have read.
Device::Mark loops_done(std::size_t launch) { return 2 + launch % 2; }

}  // namespace

bool can_simulate(const RunParts& parts) {
  const auto is_short = [](const NoiseFilter& filter) {
    return filter.num_real <= num_device_poles_max;
  };
  return *program() != '\0' && !parts.campaign.scenario.has_tests() && !parts.has_stiffness() &&
         parts.campaign.scenario.has_plain_loops() && are_alike(parts.campaign.scenario.noise) &&
         is_short(parts.noise.linear_x[0]) && is_short(parts.noise.linear_yz[0]) &&
         is_short(parts.noise.angular) &&
         std::ranges::all_of(parts.groups, [](const auto& further) { return further.empty(); });
}

MicroscopeDeviceSimulation::MicroscopeDeviceSimulation(const RunPlan& plan, const RunParts& parts,
                                                       Device& device)
    : plan_(plan), parts_(parts), device_(device) {
  device_.begin(program());
  make_tables();
  make_memory();
}

void MicroscopeDeviceSimulation::make_tables() {
  const Scenario& scenario = parts_.campaign.scenario;
  std::vector<SessionTable> tables;
  for (std::size_t i = 0; i < scenario.sessions.size(); ++i) {
    const Session& session = scenario.sessions[i];
    const SessionSignals signals(scenario, session, parts_.orbit, parts_.environment);
    const std::vector<SharedSample> samples = all_samples(signals);
    RunParts::Readers readers(parts_, i);
    const SessionSetup setup = parts_.setup(i, readers);
    const bool is_monitored = parts_.is_monitored(i);
    tables.push_back({.samples = upload(device_, samples),
                      .weights = upload(device_, all_weights(parts_.weights[i])),
                      .residual = is_monitored
                                      ? upload(device_, all_weights(*parts_.residual_weights[i]))
                                      : nullptr,
                      .num_settling = static_cast<std::uint64_t>(signals.num_settling()),
                      .reference = signals.reference_at_start(),
                      .streams = noise_streams(session.name),
                      .num_lines = static_cast<std::uint32_t>(parts_.weights[i].num_fit_lines()),
                      .kind = static_cast<std::uint32_t>(
                          sample_kind_for(setup.masses, setup.signals, setup.product,
                                          is_monitored ? Monitoring::on : Monitoring::off)),
                      .product = setup.product,
                      .signals = setup.signals});
    num_samples_.push_back(samples.size());
    starts_.push_back(start_streams(session.name));
  }
  tables_ = upload(device_, tables);
  shared_ = {.filter = {parts_.noise.linear_x[0], parts_.noise.linear_yz[0], parts_.noise.angular},
             .star_tracker_factor = parts_.noise.star_tracker_factor,
             .thrust_deviation = parts_.noise.thrust_deviation,
             .torque_deviation = parts_.noise.torque_deviation,
             .drag_free = parts_.drag_free,
             .attitude = parts_.attitude,
             .seed = parts_.campaign.seed};
}

void MicroscopeDeviceSimulation::make_memory() {
  num_at_once_ = device_.num_resident_blocks("proofmass_loop", group_lanes, fast_bytes);
  // While the sums of a slot are fetched, another one takes its place.
  const std::size_t num_slots = num_at_once_ + num_at_once_ / 8 + 1;
  const auto words = [&](std::size_t words_a_lane) {
    return allocate<std::uint64_t>(device_, num_slots * words_a_lane * group_lanes);
  };
  memory_.runs = words(1);
  memory_.constants = words(num_words<LoopConstants<double>>);
  memory_.noise_states = words(num_coloured_channels * num_words<NoiseState<double>>);
  memory_.states = words(num_words<LaneState>);
  const std::size_t for_noise = device_.free_bytes() / 2;
  const std::size_t samples = for_noise / (2 * num_at_once_ * noise_sample_bytes);
  memory_.launch_samples = static_cast<std::uint32_t>(
      std::min(launch_samples_max, samples / samples_per_noise_block * samples_per_noise_block));
  if (memory_.launch_samples == 0) throw DeviceError("too little memory for the noise of a launch");
  for (std::size_t i = 0; i < 2; ++i) {
    noise_[i] =
        allocate<std::byte>(device_, num_at_once_ * memory_.launch_samples * noise_sample_bytes);
    portions_[i] = allocate<Portion>(device_, num_at_once_);
  }
  slots_.resize(num_slots);
}

void MicroscopeDeviceSimulation::add(std::uint64_t number, std::span<const RunRequest> requests) {
  PROOFMASS_EXPECT(!requests.empty() && requests.size() <= group_lanes);
  RunGroup& group = groups_[number];
  for (const RunRequest& request : requests) {
    const AcceptedDraw draw = draw_instrument(parts_.campaign, request.run, request.table_values);
    group.records.push_back(parts_.drawn_record(request.run, draw));
    if (!draw.instrument) continue;
    group.instruments.push_back(*draw.instrument);
    group.record_of.push_back(group.records.size() - 1);
  }
  num_in_flight_ += requests.size();
  if (group.instruments.empty()) return;
  group.num_sessions_left = num_samples_.size();
  for (std::size_t i = 0; i < num_samples_.size(); ++i) {
    waiting_.emplace(num_samples_[i], Slot{.group = &group, .session = i});
  }
}

int MicroscopeDeviceSimulation::num_steps_done(std::uint64_t group) const {
  const auto num_all = std::accumulate(num_samples_.begin(), num_samples_.end(), 0.0);
  const auto num_done = static_cast<double>(groups_.at(group).num_samples_done);
  return static_cast<int>(num_done / num_all * plan_.num_steps());
}

/// Gives a free slot to the longest session that waits.
void MicroscopeDeviceSimulation::begin_session(std::uint32_t index) {
  const Slot& slot = slots_[index] = waiting_.extract(waiting_.begin()).mapped();
  const RunGroup& group = *slot.group;

  const Scenario& scenario = parts_.campaign.scenario;
  const Session& session = scenario.sessions[slot.session];
  constexpr std::size_t constants_words = num_words<LoopConstants<double>> * group_lanes;
  constexpr std::size_t noise_words = num_words<NoiseState<double>> * group_lanes;
  std::vector<std::uint64_t> runs(group_lanes);
  std::vector<std::uint64_t> constants(constants_words);
  std::vector<std::uint64_t> noise(num_coloured_channels * noise_words);
  for (std::size_t lane = 0; lane < group_lanes; ++lane) {
    const std::size_t i = std::min(lane, group.instruments.size() - 1);
    const RunIndex run = group.records[group.record_of[i]].run;
    runs[lane] = run.value;
    store_words(make_loop_constants(group.instruments[i], scenario, session), constants.data(),
                lane);
    const NoiseStates<double> states =
        stationary_states(parts_.noise, parts_.campaign.seed, run, starts_[slot.session]);
    for (std::size_t c = 0; c < states.size(); ++c) {
      store_words(states[c], noise.data() + c * noise_words, lane);
    }
  }
  const auto put = [&](std::uint64_t* memory, const std::vector<std::uint64_t>& words) {
    device_.copy_in(memory + index * words.size(), std::as_bytes(std::span(words)));
  };
  put(memory_.runs, runs);
  put(memory_.constants, constants);
  put(memory_.noise_states, noise);
}

/// Adds the next samples of a slot to a launch.
void MicroscopeDeviceSimulation::add_portion(std::uint32_t index, std::vector<Portion>& portions) {
  Slot& slot = slots_[index];
  const std::uint64_t left = num_samples_[slot.session] - slot.next;
  if (left == 0) return;  // Its sums are to be fetched.
  const auto count =
      static_cast<std::uint32_t>(std::min<std::uint64_t>(left, memory_.launch_samples));
  portions.push_back({.session = static_cast<std::uint32_t>(slot.session),
                      .slot = index,
                      .num_lanes = static_cast<std::uint32_t>(slot.group->instruments.size()),
                      .first = slot.next,
                      .count = count});
  slot.next += count;
  slot.group->num_samples_done += count;
  if (count == left) ending_.push_back(index);
}

void MicroscopeDeviceSimulation::launch() {
  std::vector<Portion> portions;
  const auto num_slots = static_cast<std::uint32_t>(slots_.size());
  for (std::uint32_t i = 0; i < num_slots; ++i) {
    if (slots_[i].group != nullptr) add_portion(i, portions);
  }
  for (std::uint32_t i = 0; i < num_slots && portions.size() < num_at_once_; ++i) {
    if (slots_[i].group != nullptr || waiting_.empty()) continue;
    begin_session(i);
    add_portion(i, portions);
  }
  if (portions.empty()) return;
  const std::size_t turn = num_launches_++ % 2;
  device_.copy_in(portions_[turn], std::as_bytes(std::span(portions)));
  memory_.noise = noise_[turn];
  std::array<void*, 4> arguments{&shared_, &tables_, &memory_, &portions_[turn]};
  const Device::Mark noise_made = turn;
  device_.launch(Device::Queue::first, {.kernel = "proofmass_noise",
                                        .num_blocks = portions.size(),
                                        .num_blocks_y = num_noise_channels,
                                        .num_threads = group_lanes,
                                        .arguments = arguments,
                                        .after = loops_done(turn),
                                        .mark = noise_made});
  device_.launch(Device::Queue::second, {.kernel = "proofmass_loop",
                                         .num_blocks = portions.size(),
                                         .num_threads = group_lanes,
                                         .shared_bytes = fast_bytes,
                                         .arguments = arguments,
                                         .after = noise_made,
                                         .mark = loops_done(turn)});
}

std::vector<DeviceSimulation::Ended> MicroscopeDeviceSimulation::advance() {
  const std::vector<std::uint32_t> ending = std::exchange(ending_, {});
  const std::size_t num_before = num_launches_;
  launch();
  if (num_before > 0) device_.wait(loops_done(num_before - 1));
  for (const std::uint32_t slot : ending) end_session(slot);
  return take_ended();
}

void MicroscopeDeviceSimulation::end_session(std::uint32_t index) {
  Slot& slot = slots_[index];
  std::vector<std::uint64_t> words(num_words<LaneState> * group_lanes);
  device_.copy_out(std::as_writable_bytes(std::span(words)), memory_.states + index * words.size());
  RunGroup& group = *slot.group;
  for (std::size_t lane = 0; lane < group.instruments.size(); ++lane) {
    const auto state = load_words<LaneState>(words.data(), lane);
    const SessionOutcome outcome{.sums = state.sums,
                                 .health = {.acceleration_m_s2 = state.loop.largest_acceleration,
                                            .attitude_rad = state.loop.largest_angle,
                                            .monitor = state.monitor}};
    parts_.keep(slot.session, outcome, group.records[group.record_of[lane]]);
  }
  --group.num_sessions_left;
  slot.group = nullptr;
}

std::vector<DeviceSimulation::Ended> MicroscopeDeviceSimulation::take_ended() {
  std::vector<Ended> all;
  std::erase_if(groups_, [&](const auto& entry) {
    const auto& [number, group] = entry;
    if (group.num_sessions_left > 0) return false;
    Ended& ended = all.emplace_back(Ended{.group = number, .results = {}});
    for (const RunRecord& record : group.records) ended.results.push_back(plan_.estimate(record));
    num_in_flight_ -= group.records.size();
    return true;
  });
  return all;
}

}  // namespace proofmass::gpu
