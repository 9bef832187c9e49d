#include "tests/tidy/rules.hpp"

#include "tests/test.hpp"

namespace proofmass::test {
namespace {

Findings layers(const std::string& path, const std::string& include) {
  return check_layers({path, "#include " + include + "\n"});
}

TEST(CodeOf, BlanksCommentsAndLiterals) {
  EXPECT_EQ(code_of("a /* { */ b // {\nc"), "a         b     \nc");
  EXPECT_EQ(code_of("f(\"a\\\"{\", '{', 1'000)"), "f(      ,    , 1'000)");
  EXPECT_EQ(code_of("R\"x({)\" )x\";"), "           ;");
}

TEST(CheckLayers, CatchesEachForbiddenInclude) {
  EXPECT_THAT(layers("core/a.cpp", "<chrono>"),
              ElementsAre("core/a.cpp:1: chrono: core has no clock, thread, file, logger or random "
                          "device"));
  EXPECT_THAT(layers("core/a.cpp", "\"coordinator/store/store.hpp\""), SizeIs(1));
  EXPECT_THAT(layers("core/a.hpp", "<sqlite3.h>"), SizeIs(1));
  EXPECT_THAT(layers("core/campaign/a.cpp", "\"core/definition/document.hpp\""), SizeIs(1));
  EXPECT_THAT(layers("core/campaign/a.cpp", "<toml++/toml.h>"), SizeIs(1));
  EXPECT_THAT(layers("proto/wire/a.cpp", "<toml++/toml.h>"), SizeIs(1));
  EXPECT_THAT(layers("coordinator/store/store.hpp", "<sqlite3.h>"), SizeIs(1));
  EXPECT_THAT(layers("coordinator/cli/commands/query.cpp", "<sqlite3ext.h>"), SizeIs(1));
  EXPECT_THAT(layers("coordinator/dispatch/a.cpp", "<zmq.hpp>"), SizeIs(1));
  EXPECT_THAT(layers("coordinator/net/a.hpp", "<zmq.hpp>"), SizeIs(1));
  EXPECT_THAT(layers("coordinator/page/page.cpp", "<boost/asio/post.hpp>"), SizeIs(1));
  EXPECT_THAT(layers("core/random/stream.cpp", "<boost/random/sobol.hpp>"), SizeIs(1));
  EXPECT_THAT(layers("coordinator/dispatch/state.hpp", "\"proto/proofmass.pb.h\""), SizeIs(1));
  EXPECT_THAT(layers("coordinator/store/a.hpp", "\"proto/wire/client_codec.hpp\""), SizeIs(1));
  EXPECT_THAT(layers("coordinator/store/a.cpp", "<google/protobuf/message.h>"), SizeIs(1));
  EXPECT_THAT(layers("proto/wire/a.cpp", "\"worker/net/a.hpp\""), SizeIs(1));
  EXPECT_THAT(layers("coordinator/cli/a.cpp", "\"worker/net/a.hpp\""), SizeIs(1));
  EXPECT_THAT(layers("worker/a.cpp", "\"coordinator/net/a.hpp\""), SizeIs(1));
}

TEST(CheckLayers, KeepTheEngineFromKnowingOneModel) {
  const std::string model = "\"core/microscope/results/results.hpp\"";
  for (const std::string path :
       {"proto/wire/a.cpp", "proto/wire/a.hpp", "coordinator/report/a.hpp", "coordinator/cli/a.cpp",
        "coordinator/cli/main.cpp", "coordinator/query/extension.cpp", "worker/main.cpp",
        "core/campaign/a.cpp", "core/definition/a.cpp", "core/signal/a.hpp", "core/model.hpp"}) {
    EXPECT_THAT(layers(path, model), SizeIs(1)) << path;
  }
  for (const std::string path : {"core/microscope/instrument/a.hpp", "tests/worker/a.cpp"}) {
    EXPECT_THAT(layers(path, model), IsEmpty()) << path;
  }
}

TEST(CheckLayers, WantIncludesWrittenFromTheRoot) {
  for (const std::string include :
       {"\"store.hpp\"", "\"../report/report.hpp\"", "<../microscope/a.hpp>",
        "\"core/../core/microscope/a.hpp\"", "\"core/./runs.hpp\"", "\"core//runs.hpp\"",
        "\"/core/runs.hpp\"", "</core/runs.hpp>", "A_MACRO"}) {
    EXPECT_THAT(layers("coordinator/store/a.cpp", include), SizeIs(1)) << include;
    EXPECT_THAT(layers("tests/coordinator/store/a.cpp", include), SizeIs(1)) << include;
  }
  EXPECT_THAT(layers("coordinator/store/a.cpp", "\"core/runs.hpp\""), IsEmpty());
  EXPECT_THAT(layers("coordinator/store/a.cpp", "<core/microscope/a.hpp>"), SizeIs(1));
  EXPECT_THAT(layers("tests/store/a.cpp", "\"tests/test.hpp\""), IsEmpty());
  EXPECT_THAT(layers("deploy/project/a.cpp", "\"a.hpp\""), IsEmpty());
  EXPECT_THAT(layers("deploy/project/a.cpp", "\"../b/a.hpp\""), SizeIs(1));
}

// The parts in their order: whatever comes later may include what comes earlier, never the other
// way round.
void expect_order(const std::string& folder, const std::vector<std::string>& parts) {
  for (std::size_t i = 0; i < parts.size(); ++i) {
    for (std::size_t j = 0; j < parts.size(); ++j) {
      const Findings findings =
          layers(folder + "/" + parts[i], "\"" + folder + "/" + parts[j] + "\"");
      EXPECT_THAT(findings, SizeIs(i < j ? 1 : 0)) << parts[i] << " includes " << parts[j];
    }
  }
}

TEST(CheckLayers, KeepTheOrderOfCore) {
  expect_order("core", {"error.hpp", "runs.hpp", "math/a.hpp", "random/a.hpp", "signal/a.hpp",
                        "statistics/detail/a.hpp", "campaign/a.hpp", "definition/a.hpp",
                        "model.hpp", "result_rules.hpp"});
  EXPECT_THAT(layers("core/campaign/a.cpp", "\"core/model.hpp\""),
              ElementsAre("core/campaign/a.cpp:1: core/model.hpp: campaign comes before model in "
                          "the order of core"));
  EXPECT_THAT(layers("core/microscope/definition/a.cpp", "\"core/model.hpp\""), IsEmpty());
}

TEST(CheckLayers, KeepTheOrderOfTheModel) {
  expect_order("core/microscope",
               {"orbit/a.hpp", "environment/a.hpp", "session/a.hpp", "results/a.hpp",
                "instrument/a.hpp", "control/a.hpp", "estimation/hardy2013/a.hpp", "campaign/a.hpp",
                "simulation/a-inl.hpp", "definition/a.hpp", "microscope_model.cpp"});
}

TEST(CheckLayers, WantAPlaceInTheOrderForEveryFolder) {
  EXPECT_THAT(layers("core/filters/a.hpp", "\"core/runs.hpp\""),
              ElementsAre("core/filters/a.hpp:1: core/runs.hpp: filters has no place in the order "
                          "of core (tests/tidy/rules.cpp)"));
  EXPECT_THAT(layers("core/microscope/orbit/a.hpp", "\"core/microscope/drag/a.hpp\""), SizeIs(1));
}

TEST(CheckLayers, KeepTextToDefinitionsAndModels) {
  const std::string document = "\"core/definition/document.hpp\"";
  EXPECT_THAT(layers("core/microscope/definition/a.cpp", document), IsEmpty());
  EXPECT_THAT(layers("core/microscope/microscope_model.cpp", document), IsEmpty());
  EXPECT_THAT(layers("core/microscope/simulation/a.cpp", document), SizeIs(1));
  EXPECT_THAT(layers("core/statistics/a.cpp", document), SizeIs(1));
}

TEST(CheckLinks, CatchesALibraryThatIsLinkedWithAModel) {
  const std::string link = "\ntarget_link_libraries(proofmass_cli\n  PUBLIC fmt::fmt ";
  EXPECT_THAT(check_links({"coordinator/cli/CMakeLists.txt", link + "proofmass::microscope)"}),
              ElementsAre("coordinator/cli/CMakeLists.txt:3: proofmass::microscope: only a program "
                          "is linked with a model, not proofmass_cli"));
  for (const std::string library : {"proofmass::microscope_model", "proofmass_microscope"}) {
    EXPECT_THAT(check_links({"coordinator/cli/CMakeLists.txt", link + library + ")"}), SizeIs(1));
    EXPECT_THAT(check_links({"proto/CMakeLists.txt", link + library + ")"}), SizeIs(1));
    EXPECT_THAT(check_links({"CMakeLists.txt", "link_libraries(" + library + ")"}), SizeIs(1));
  }
}

TEST(CheckHeaderGuard, CatchesAHeaderWithoutOne) {
  EXPECT_THAT(check_header_guard({"core/a.hpp", "#include <array>\n"}), SizeIs(1));
  EXPECT_THAT(check_header_guard({"core/a.hpp", "#pragma once\n"}), IsEmpty());
  EXPECT_THAT(check_header_guard({"core/a.cpp", ""}), IsEmpty());
}

TEST(CheckSize, CatchesALongLineAndALongFile) {
  EXPECT_THAT(check_size({"a.cpp", "ok\n" + std::string(101, 'x') + "\n"}),
              ElementsAre("a.cpp:2: 101 columns"));
  EXPECT_THAT(check_size({"a.cpp", std::string(100, 'x')}), IsEmpty());
  std::string greek;
  for (int i = 0; i < 100; ++i) greek += "Δ";
  EXPECT_THAT(check_size({"a.cpp", greek}), IsEmpty());
  EXPECT_THAT(check_size({"a.cpp", std::string(501, '\n')}), SizeIs(1));
  EXPECT_THAT(check_size({"a.cpp", std::string(500, '\n')}), IsEmpty());
}

std::string function_of(int num_lines, const std::string& head) {
  return head + " {" + std::string(static_cast<std::size_t>(num_lines - 1), '\n') + "}\n";
}

TEST(CheckFunctionLength, CatchesALongFunctionOfAnyKind) {
  for (const std::string head :
       {"void f()", "int A::f(int a) const", "auto f() -> int", "A::A(int a) : a_(a), b_{a}",
        "TEST(A, B)", "template <typename T>\nT f(T a) noexcept"}) {
    EXPECT_THAT(check_function_length({"a.cpp", function_of(71, head)}), SizeIs(1)) << head;
    EXPECT_THAT(check_function_length({"a.cpp", function_of(70, head)}), IsEmpty()) << head;
    const std::string nested =
        "namespace a {\nclass A : public B {\n" + function_of(71, head) + "};\n}\n";
    EXPECT_THAT(check_function_length({"a.cpp", nested}), SizeIs(1)) << head;
  }
}

TEST(CheckOpenWork, CatchesMarksWithoutAnIssue) {
  const std::string mark = std::string("TO") + "DO";
  EXPECT_THAT(check_open_work({"a.cpp", "// " + mark + ": later\n"}), SizeIs(1));
  EXPECT_THAT(check_open_work({"a.cpp", std::string("// FIX") + "ME\n"}), SizeIs(1));
  EXPECT_THAT(check_open_work({"a.cpp", "// " + mark + "(#12): later\n"}), IsEmpty());
}

TEST(CheckElementaryFunctions, CatchesCallsOfTheLibraryInCore) {
  for (const std::string call : {"std::sin(x)", "::cos(x)", "y = exp(x)", "std::pow (x, 2)",
                                 "std::atan2(y, x)", "std::logf(x)", "std::polar(1.0, x)"}) {
    EXPECT_THAT(check_elementary_functions({"core/a.cpp", call}), SizeIs(1)) << call;
    EXPECT_THAT(check_elementary_functions({"tests/a.cpp", call}), IsEmpty()) << call;
  }
}

TEST(CheckWords, CatchesBannedWordsInsideIdentifiers) {
  for (const std::string name : {"job", "num_tasks", "TaskQueue", "masterKey", "trial_",
                                 "node_count", "slave1 = slaves", "StoreManager"}) {
    EXPECT_THAT(check_words({"a.cpp", name}), ::testing::Not(IsEmpty())) << name;
  }
}

TEST(CheckAllBuilt, CatchesASourceThatNoCMakeListsNames) {
  const SourceFile lists{"core/CMakeLists.txt", "add_library(core\n  signal/a.cpp\n  b.cpp)\n"};
  EXPECT_THAT(check_all_built({lists, {"core/signal/a.cpp", ""}, {"core/b.cpp", ""}}), IsEmpty());
  EXPECT_THAT(check_all_built({lists, {"core/a.cpp", ""}}),
              ElementsAre("core/a.cpp:1: in no CMakeLists.txt"));
  EXPECT_THAT(check_all_built({lists, {"worker/b.cpp", ""}}), SizeIs(1));
  const SourceFile root{"CMakeLists.txt", "add_library(x worker/b.cpp)"};
  EXPECT_THAT(check_all_built({root, {"worker/b.cpp", ""}}), IsEmpty());
}

TEST(CheckTypesUnique, CatchesTwoOfOneName) {
  const SourceFile first{"core/a.hpp", "namespace proofmass {\nstruct Draw {\n};\n}\n"};
  const SourceFile second{"worker/b.hpp", "namespace proofmass {\nclass Draw final : Base {\n"};
  EXPECT_THAT(check_types_unique({first, second}),
              ElementsAre("worker/b.hpp:2: proofmass::Draw is also in core/a.hpp"));
  const SourceFile declaration{"core/c.hpp", "namespace proofmass {\nstruct Draw;\n"};
  const SourceFile elsewhere{"worker/d.hpp", "namespace proofmass::worker {\nstruct Draw {\n"};
  const SourceFile of_tests{"tests/e.hpp", "namespace proofmass {\nstruct Draw {\n"};
  EXPECT_THAT(check_types_unique({first, declaration, elsewhere, of_tests}), IsEmpty());
}

}  // namespace
}  // namespace proofmass::test
