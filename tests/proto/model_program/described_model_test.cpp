// What databases say of their models, well or ill. The built-in model is that of MICROSCOPE.

#include "proto/model_program/described_model.hpp"

#include <fmt/format.h>

#include "core/model.hpp"
#include "tests/test.hpp"

namespace proofmass::wire {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// A description of `ruler-1` in which one key is another one.
std::string description(const std::string& instead = {}) {
  std::string text =
      R"("proofmass_model_program": 1, "name": "ruler", "version": "1",)"
      R"( "parameters": [{"name": "offset_m", "value": 0.5}],)"
      R"( "drawn": [{"name": "scale", "law": "fixed", "value": 3}],)"
      R"( "quantities": [{"name": "length", "truth": "2 * scale + offset_m", "unit": "m"}])";
  return "{" + text + (instead.empty() ? "" : ", ") + instead + "}";
}

std::string refusal_of(const std::string& text) {
  try {
    (void)stored_model("ruler-1", text);
  } catch (const ModelProgramError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(StoredModel, IsThatOfTheProgramIfTheDatabaseIsOfIt) {
  EXPECT_EQ(&stored_model(model().version(), ""), &model());
  EXPECT_EQ(&stored_model("hardy2013-2", ""), &model());
  EXPECT_EQ(&stored_model("hardy2013-2", description()), &model());
  EXPECT_EQ(refusal_of(""), fmt::format("is of the model ruler-1, and this program has {}; "
                                        "--model-program names that of another model",
                                        model().version()));
}

TEST(StoredModel, DrawsAndKnowsTheTruthWithoutItsProgram) {
  const Model& ruler = stored_model("ruler-1", description());
  EXPECT_EQ(ruler.version(), "ruler-1");
  const std::unique_ptr<Campaign> campaign =
      ruler.campaign_of({.text = ruler.example()}, TableColumns::included, "test");
  EXPECT_EQ(&campaign->model(), &ruler);
  const RunDraw draw = campaign->draw(RunIndex{0});
  EXPECT_THAT(draw.values, ElementsAre(3.0));
  EXPECT_THAT(draw.truth, ElementsAre(6.5));
  EXPECT_EQ(campaign->results().quantities.front().unit, "m");
}

TEST(StoredModel, ComputesNothingAndSaysWhatWould) {
  const Model& ruler = stored_model("ruler-1", description());
  EXPECT_FALSE(ruler.can_simulate());
  const auto campaign =
      ruler.campaign_of({.text = ruler.example()}, TableColumns::included, "test");
  try {
    (void)campaign->prepare();
    FAIL();
  } catch (const ModelProgramError& error) {
    EXPECT_EQ(std::string(error.what()),
              "model = ruler-1 (its program is needed to compute runs: name it with "
              "--model-program)");
  }
}

TEST(StoredModel, IsOneForOneText) {
  EXPECT_EQ(&stored_model("ruler-1", description()), &stored_model("ruler-1", description()));
  const Model& other = stored_model("ruler-1", description(R"("purpose": "Measures.")"));
  EXPECT_NE(&stored_model("ruler-1", description()), &other);
  // Its text begins with the first key of the alphabet, and describes it again.
  EXPECT_EQ(other.description().substr(0, 9), R"({"drawn":)");
  EXPECT_EQ(stored_model("ruler-1", other.description()).description(), other.description());
}

TEST(StoredModel, IsRefusedIfItsDescriptionBreaksARule) {
  const std::string quantity = R"({"name": "q", "truth": "scale"})";
  std::string many = quantity;
  for (int i = 1; i < 1000; ++i) many += "," + quantity;
  std::string deep(400'000, '[');
  deep += std::string(400'000, ']');
  struct {
    std::string text, reason;
  } const cases[] = {
      {"DROP TABLE campaign", "description: no JSON"},
      {"[]", "answer = [] (must be an object)"},
      {description(R"("version": "2")"), "description: of ruler-2"},
      {description(R"("version": "1\u001b[2J")"), "(must be a text of one line"},
      {description(R"("version": "1\u202e")"), "(must be a text of one line"},
      {description(R"("quantities": [)" + many + "]"), "must be a list of at most 63"},
      {description(R"("quantities": [{"name": "x); DROP TABLE campaign; --", "truth": "1"}])"),
       "must be 1 to 64 of [a-z0-9_], a letter first"},
      {description(R"("quantities": [{"name": "q", "truth": "x"}])"),
       "x is neither drawn nor a parameter"},
      {description(R"("drawn": [{"name": "scale", "law": "table", "column": "/etc/passwd"}])"),
       "drawn[0].law = \"table\""},
      {description(R"("quantities": )" + deep), "quantities"},
      {description(R"("purpose": ")" + std::string(answer_size_max, 'x') + R"(")"),
       "(must be at most 1048576)"}};
  for (const auto& [text, reason] : cases) {
    EXPECT_THAT(refusal_of(text), HasSubstr(reason));
    EXPECT_THAT(refusal_of(text), HasSubstr("is of the model ruler-1: "));
  }
}

}  // namespace
}  // namespace proofmass::wire
