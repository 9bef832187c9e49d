// What databases say of their models, well or ill. The built-in model is that of MICROSCOPE.

#include "proto/model_program/described_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "core/campaign/recording.hpp"
#include "core/campaign/result_columns.hpp"
#include "core/math/hash.hpp"
#include "core/model.hpp"
#include "tests/test.hpp"

namespace proofmass::wire {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;

/// A description of `ruler-1` in which one key is another one.
std::string description(const std::string& instead = {}) {
  std::string text;
  const auto add = [&text](const std::string& part) {
    if (!part.empty()) text += (text.empty() ? "" : ", ") + part;
  };
  for (const std::string part :
       {R"("proofmass_model_program": 1)", R"("name": "ruler")", R"("version": "1")",
        R"("parameters": [{"name": "offset_m", "value": 0.5}])",
        R"("drawn": [{"name": "scale", "law": "fixed", "value": 3}])",
        R"("quantities": [{"name": "length", "truth": "2 * scale + offset_m", "unit": "m"}])"}) {
    if (part.substr(0, part.find(':')) != instead.substr(0, instead.find(':'))) add(part);
  }
  add(instead);
  return "{" + text + "}";
}

const Model& ruler(const std::string& description, std::uint64_t reference_digest = 0) {
  return recorded_model(
      {.version = "ruler-1", .description = description, .reference_digest = reference_digest});
}

std::unique_ptr<Campaign> example_of(const Model& model) {
  std::string text = model.example();
  const std::string line = "model = \"ruler\"\n";  // For people; it is no part of a definition.
  const std::size_t place = text.find(line);
  EXPECT_NE(place, text.npos);
  text.erase(place, line.size());
  return model.campaign_of({.text = text}, TableColumns::included, "test");
}

std::string refusal_of(const std::string& text) {
  try {
    (void)ruler(text);
  } catch (const DefinitionError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(RecordedModel, IsThatOfTheProgramIfTheDatabaseIsOfIt) {
  EXPECT_EQ(&recorded_model({.version = std::string(model().version())}), &model());
  EXPECT_EQ(&recorded_model({.version = "hardy2013-2"}), &model());
  EXPECT_EQ(&recorded_model({.version = "hardy2013-2", .description = description()}), &model());
  EXPECT_EQ(refusal_of(""), fmt::format("is of the model ruler-1, and this program has {}; "
                                        "--model-program names that of another model",
                                        model().version()));
}

TEST(RecordedModel, DrawsAndKnowsTheTruthWithoutItsProgram) {
  const Model& known = ruler(description());
  EXPECT_EQ(known.version(), "ruler-1");
  const std::unique_ptr<Campaign> campaign = example_of(known);
  EXPECT_EQ(&campaign->model(), &known);
  EXPECT_EQ(campaign->definition(TableColumns::included).model, "ruler-1");
  const RunDraw draw = campaign->draw(RunIndex{0});
  EXPECT_THAT(draw.values, ElementsAre(3.0));
  EXPECT_THAT(draw.truth, ElementsAre(6.5));
  EXPECT_EQ(campaign->results().quantities.front().unit, "m");
}

TEST(RecordedModel, ComputesNothingAndSaysWhatWould) {
  const Model& known = ruler(description());
  EXPECT_FALSE(known.can_simulate());
  const std::unique_ptr<Campaign> campaign = example_of(known);
  try {
    (void)campaign->prepare();
    FAIL();
  } catch (const ModelProgramError& error) {
    EXPECT_EQ(std::string(error.what()),
              "model = ruler-1 (its program is not here; name it with --model-program)");
  }
}

TEST(RecordedModel, ComputesWhatItDidWhereItsProgramWas) {
  const Model& known = ruler(description(), 0x1234);
  EXPECT_EQ(known.reference_digest(best_instruction_set()), 0x1234U);
  EXPECT_EQ(&ruler(description(), 0x1234), &known);
  EXPECT_EQ(ruler(description(), 0x5678).reference_digest(best_instruction_set()), 0x5678U);
  EXPECT_EQ(known.reference_digest(best_instruction_set()), 0x1234U);
}

TEST(RecordedModel, IsOneForOneText) {
  EXPECT_EQ(&ruler(description()), &ruler(description()));
  const Model& other = ruler(description(R"("purpose": "Measures.")"));
  EXPECT_NE(&ruler(description()), &other);
  // Its text begins with the first key of the alphabet, and describes it again.
  EXPECT_EQ(other.description().substr(0, 9), R"({"drawn":)");
  EXPECT_EQ(ruler(std::string(other.description())).description(), other.description());
}

// A campaign whose runs took too long goes on with another limit, and its reference runs are the
// same; what may change a result needs another version.
TEST(RecordedModel, IsTheSameWithOtherLimits) {
  const std::uint64_t digest = ruler(description()).description_digest();
  for (const char* const limit : {R"("purpose": "Measures.")", R"("runs_at_once": 8)",
                                  R"("run_time_max_s": 7)", R"("memory_max_mib": 100)"}) {
    EXPECT_EQ(ruler(description(limit)).description_digest(), digest) << limit;
  }
  for (const char* const other : {R"("streams": [{"name": "noise"}])",
                                  R"("parameters": [{"name": "offset_m", "value": 0.25}])"}) {
    EXPECT_NE(ruler(description(other)).description_digest(), digest) << other;
  }
  EXPECT_NE(digest, 0U);
}

/// Of a program that estimates 1.5 in each run, or what it was changed to.
class FixedPlan final : public Plan {
 public:
  explicit FixedPlan(double estimate = 1.5) : estimate_(estimate) {}
  [[nodiscard]] std::vector<RunResult> simulate_batch(
      std::span<const RunRequest> requests, InstructionSet,
      const std::function<void(int)>&) const override {
    return {{.run = requests.front().run, .truth = {1.0}, .estimate = {estimate_}}};
  }
  [[nodiscard]] RunResult replay(const RunRequest& request, const SampleSink&,
                                 const std::function<void(int)>&) const override {
    return simulate_batch({&request, 1}, InstructionSet::scalar, {}).front();
  }
  [[nodiscard]] const Recording& recording() const override { return recording_; }
  [[nodiscard]] int num_steps() const override { return 1; }

 private:
  const double estimate_;
  const Recording recording_;
};

// Campaigns that older programs began go on.
TEST(ReferenceDigest, OfAnOlderProgramHadLimitsInIt) {
  const auto model_with = [](const std::string& limit) {
    return std::make_unique<DescribedModel>(description_in(description(limit), "test"),
                                            std::nullopt,
                                            [](const DescribedCampaign&, const OnProcessStart&) {
                                              return std::make_unique<const FixedPlan>();
                                            });
  };
  const auto before = model_with(R"("run_time_max_s": 2)"), now = model_with(R"("purpose": "P.")");
  const auto set = InstructionSet::scalar;
  EXPECT_EQ(now->reference_digest(set), before->reference_digest(set));
  std::uint64_t former = fnv1a(before->description());
  for (int run = 0; run < 3; ++run) former = fnv1a(former, std::bit_cast<std::uint64_t>(1.5));
  EXPECT_NE(former, now->reference_digest(set));
  ModelRecord record{.version = "ruler-1",
                     .description = std::string(before->description()),
                     .reference_digest = former};
  EXPECT_EQ(current_reference_digest(*now, record), now->reference_digest(set));
  // Where the program is not, nobody can tell; nor is another result the same.
  EXPECT_EQ(current_reference_digest(ruler(record.description), record), former);
  record.reference_digest = 0x1234;
  EXPECT_EQ(current_reference_digest(*now, record), 0x1234U);
}

// Whoever has told others of the digest must not compute with other code.
TEST(ReferenceRuns, AreRepeatedForEachProcessOfWhichNothingIsKnown) {
  double estimate = 1.5;
  int num_repetitions = -1;  // The first plan is that of the reference runs.
  OnProcessStart on_start;
  const DescribedModel model(description_in(description(), "test"), std::nullopt,
                             [&](const DescribedCampaign&, const OnProcessStart& called) {
                               if (called) on_start = called;
                               if (!called) ++num_repetitions;
                               return std::make_unique<const FixedPlan>(estimate);
                             });
  (void)example_of(model)->prepare();
  const auto first = std::chrono::steady_clock::now(), second = first + 1h;
  on_start(first);
  EXPECT_EQ(num_repetitions, -1) << "nobody knows of a digest";
  (void)model.reference_digest(InstructionSet::scalar);
  on_start(first);
  on_start(first);
  EXPECT_EQ(num_repetitions, 1) << "its code is no newer than that of the repetition";
  on_start(second);
  EXPECT_EQ(num_repetitions, 2);
  estimate = 1.75;
  EXPECT_THAT([&] { on_start(second); },
              ThrowsMessage<ModelProgramChanged>(HasSubstr("its code has changed")));
}

/// What is wrong with the names of a model program.
std::string name_refusal_of(const std::string& text) {
  try {
    check_names(static_cast<const DescribedModel&>(ruler(text)), "p.py: description");
  } catch (const DefinitionError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Names, AreNotThoseOfColumnsAndFunctions) {
  for (const char* const name : {"run_index", "status", "num_draws", "loss_cause", "truth_length",
                                 "estimate_length", "error_length"}) {
    const std::string more = fmt::format(R"(,{{"name": "{}", "law": "fixed", "value": 1}}])", name);
    const std::string drawn = R"("drawn": [{"name": "scale", "law": "fixed", "value": 3})" + more;
    EXPECT_EQ(name_refusal_of(description(drawn)),
              fmt::format("p.py: description: drawn.{} (must have another name: it is a column of "
                          "the results)",
                          name));
  }
  EXPECT_EQ(
      name_refusal_of(description(
          R"("parameters": [{"name": "offset_m", "value": 1}, {"name": "sqrt", "value": 1}])")),
      "p.py: description: parameters.sqrt (must have another name: it is a function of "
      "expressions)");
  EXPECT_EQ(name_refusal_of(description(R"("quantities": [{"name": "all", "truth": "scale"}])")),
            "p.py: description: quantities.all (must have another name: requirements say `all "
            "objectives`)");
  // Nothing is confused with these.
  EXPECT_EQ(name_refusal_of(description(R"("quantities": [{"name": "scale", "truth": "scale"},)"
                                        R"({"name": "status", "truth": "1"}])")),
            "accepted");
  const std::vector<std::string> columns = result_column_names(example_results());
  for (const DrawnQuantity& drawn : model().drawn()) {
    EXPECT_EQ(std::ranges::count(columns, drawn.name), 0) << drawn.name;
  }
}

/// As many quantities, each of which is the next one.
std::string chain(int count) {
  std::string drawn = R"({"name": "scale", "law": "fixed", "value": 3})";
  for (int i = 1; i <= count; ++i) {
    const std::string next = i == count ? "scale" : fmt::format("x{}", i + 1);
    drawn += fmt::format(R"(,{{"name": "x{}", "law": "derived", "expression": "{}"}})", i, next);
  }
  return R"("drawn": [)" + drawn + "]";
}

TEST(RecordedModel, FollowsAChainOfExpressionsThatTheStackHolds) {
  EXPECT_THAT(example_of(ruler(description(chain(64))))->draw(RunIndex{0}).values, Each(3.0));
  EXPECT_THAT(refusal_of(description(chain(66))),
              HasSubstr("more than 64 need one another in a row"));
}

TEST(RecordedModel, HasNoDrawWhereAnExpressionHasNoValue) {
  const std::string drawn =
      R"("drawn": [{"name": "scale", "law": "fixed", "value": 3},)"
      R"({"name": "x", "law": "derived", "expression": "1 / (scale - 3) + 0"}])";
  EXPECT_THAT(example_of(ruler(description(drawn)))->draw(RunIndex{0}).values, IsEmpty());
}

// Sobol's sequence has no more dimensions.
TEST(RecordedModel, HasADesignForAsManyQuantitiesAsThereAreDimensions) {
  const auto validate = [](int count) {
    std::string drawn = R"({"name": "scale", "law": "fixed", "value": 3})";
    for (int i = 1; i < count; ++i) {
      drawn += fmt::format(R"(,{{"name": "x{}", "law": "fixed", "value": 1}})", i);
    }
    const Model& model = ruler(description(R"("drawn": [)" + drawn + "]"));
    DescribedCampaign campaign(static_cast<const DescribedModel&>(model));
    campaign.num_runs = 64;
    campaign.design = {.kind = DesignKind::sobol, .points = 32};
    campaign.validate();
  };
  EXPECT_NO_THROW(validate(256));
  EXPECT_THAT([&] { validate(257); },
              ThrowsMessage<ConfigError>(HasSubstr("more than 256 drawn quantities")));
}

// Whoever reads a database of them need not have the file.
TEST(RecordedModel, OfImportedResultsHasItsDrawsInTheCampaign) {
  const Model& imported = ruler(description(
      R"("drawn": [{"name": "scale", "law": "table", "file": "/etc/passwd", "column": "s"}],)"
      R"( "imported_from": "theirs.csv")"));
  EXPECT_TRUE(imported.is_imported());
  EXPECT_EQ(imported.why_no_runs(),
            "its results were imported from theirs.csv; no more can be computed");
  Definition definition{.text = DescribedCampaign(static_cast<const DescribedModel&>(imported))
                                    .definition(TableColumns::left_out)
                                    .text,
                        .table_columns = {std::vector<double>(100, 4.0)}};
  const auto campaign = imported.campaign_of(definition, TableColumns::included, "test");
  EXPECT_THAT(campaign->draw(RunIndex{99}).truth, ElementsAre(8.5));
  definition.table_columns.front().pop_back();
  EXPECT_THROW((void)imported.campaign_of(definition, TableColumns::included, "test"),
               DefinitionError);
  EXPECT_THROW((void)imported.campaign_of(definition, TableColumns::left_out, "test"),
               DefinitionError);
}

TEST(RecordedModel, IsRefusedIfItsDescriptionBreaksARule) {
  const std::string quantity = R"({"name": "q", "truth": "scale"})";
  std::string many = quantity;
  for (int i = 1; i < 1000; ++i) many += "," + quantity;
  std::string deep(400'000, '[');
  deep += std::string(400'000, ']');
  struct {
    std::string text, reason;
  } const cases[] = {
      {"DROP TABLE campaign", "description: is no object of JSON"},
      {"[]", "description: is no object of JSON"},
      {description(R"("purpose": "NaN \" Infinity", "objective": -Infinity)"),
       "description: has Infinity at character 301, a number that JSON does not have: {"},
      {description("\"purpose\": \"m\xb2\""), "description: is no UTF-8 at byte 270: {"},
      {description(R"("name": "ruler", "name": "ruler")"), "has the key \"name\" twice: {"},
      {description(R"("version": "2")"), "description: of ruler-2"},
      {description(R"("version": "1\u001b[2J")"), "(must be a text of one line"},
      {description(R"("version": "1\u202e")"), "(must be a text of one line"},
      {description(R"("quantities": [)" + many + "]"),
       "quantities = 1000 tables (must be at most 63)"},
      {description(R"("quantities": [{"name": "x); DROP TABLE campaign; --", "truth": "1"}])"),
       "must be 1 to 64 of [a-z0-9_], a letter first"},
      {description(R"("quantities": [{"name": "q", "truth": "x"}])"),
       "x is neither drawn nor a parameter"},
      {description(
           R"("drawn": [{"name": "scale", "law": "table", "file": "/etc", "column": "passwd"}])"),
       "drawn[0].law = \"table\""},
      {description(R"("quantities": )" + deep), "quantities"},
      {description(R"("colour": "red")"), "description: colour = \"red\" (unknown key"},
      {description(R"("drawn": [{"name": "scale", "law": "fixed", "value": 3, "units": "m"}])"),
       "drawn[0].units = \"m\" (unknown key; nearest is drawn[0].unit)"},
      {description(R"("drawn": [{"name": "scale", "law": "fixed", "value": 3, "mean": 3}])"),
       "drawn[0].mean = 3 (not a key of law fixed, which has value)"},
      {description(R"("drawn": [{"name": "scale", "law": "uniform", "minimum": 3}])"),
       "drawn[0].maximum is missing"},
      {description(R"("drawn": [{"name": "scale", "value": 3}])"), "drawn[0].law is missing"},
      {description(R"("purpose": null)"), "purpose = null (must have a value, or be left out)"},
      {description(R"("purpose": ")" + std::string(answer_size_max, 'x') + R"(")"),
       "(must be at most 1048576)"}};
  for (const auto& [text, reason] : cases) {
    EXPECT_THAT(refusal_of(text), HasSubstr(reason));
    EXPECT_THAT(refusal_of(text), HasSubstr("is of the model ruler-1: "));
  }
}

}  // namespace
}  // namespace proofmass::wire
