#include "tests/tidy/rules.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace proofmass::test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

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
  EXPECT_THAT(layers("coordinator/net/a.cpp", "\"proofmass.pb.h\""), SizeIs(1));
  EXPECT_THAT(layers("proto/wire/a.hpp", "<google/protobuf/message.h>"), SizeIs(1));
  EXPECT_THAT(layers("proto/wire/a.cpp", "\"worker/net/a.hpp\""), SizeIs(1));
  EXPECT_THAT(layers("coordinator/cli/a.cpp", "\"worker/net/a.hpp\""), SizeIs(1));
  EXPECT_THAT(layers("worker/a.cpp", "\"coordinator/net/a.hpp\""), SizeIs(1));
}

TEST(CheckLayers, AllowsWhatTheLayersAreFor) {
  EXPECT_THAT(layers("coordinator/store/store.cpp", "<sqlite3.h>"), IsEmpty());
  EXPECT_THAT(layers("coordinator/query/draw_table.cpp", "<sqlite3ext.h>"), IsEmpty());
  EXPECT_THAT(layers("coordinator/query/virtual_table-inl.hpp", "<sqlite3ext.h>"), IsEmpty());
  EXPECT_THAT(layers("worker/net/a.cpp", "<zmq.hpp>"), IsEmpty());
  EXPECT_THAT(layers("coordinator/page/http_server.cpp", "<boost/beast/http.hpp>"), IsEmpty());
  EXPECT_THAT(layers("proto/wire/a.cpp", "\"proofmass.pb.h\""), IsEmpty());
  EXPECT_THAT(layers("core/a.cpp", "<cmath>"), IsEmpty());
  EXPECT_THAT(layers("core/definition/a.hpp", "<toml++/toml.h>"), IsEmpty());
  EXPECT_THAT(layers("core/microscope/definition/a.hpp", "<toml++/toml.h>"), IsEmpty());
  EXPECT_THAT(layers("tests/system/a.cpp", "<sqlite3.h>"), IsEmpty());
}

TEST(CheckLayers, KeepTheEngineFromKnowingOneModel) {
  const std::string model = "\"core/microscope/results/results.hpp\"";
  for (const std::string path :
       {"proto/wire/a.cpp", "proto/wire/a.hpp", "coordinator/report/a.hpp", "coordinator/cli/a.cpp",
        "coordinator/query/extension.cpp", "worker/program.cpp", "worker/net/main.cpp",
        "core/campaign/a.cpp", "core/definition/a.cpp", "core/signal/a.hpp"}) {
    EXPECT_THAT(layers(path, model), SizeIs(1)) << path;
  }
  for (const std::string path : {"coordinator/bench/a.cpp", "coordinator/cli/main.cpp",
                                 "coordinator/cli/coordinator_main.cpp", "worker/main.cpp",
                                 "core/microscope/session/a.hpp", "tests/worker/a.cpp"}) {
    EXPECT_THAT(layers(path, model), IsEmpty()) << path;
  }
}

TEST(CheckLayers, KeepMathematicsFromKnowingCampaigns) {
  for (const std::string topic : {"math", "random", "signal", "statistics", "statistics/detail"}) {
    const std::string path = "core/" + topic + "/a.cpp";
    EXPECT_THAT(layers(path, "\"core/campaign/campaign.hpp\""), SizeIs(1)) << path;
    EXPECT_THAT(layers(path, "\"core/runs.hpp\""), IsEmpty()) << path;
  }
  EXPECT_THAT(layers("core/definition/a.hpp", "\"core/campaign/definition.hpp\""), IsEmpty());
}

TEST(CheckLayers, KeepTextToDefinitionsAndModels) {
  const std::string document = "\"core/definition/document.hpp\"";
  EXPECT_THAT(layers("core/microscope/definition/a.cpp", document), IsEmpty());
  EXPECT_THAT(layers("core/microscope/microscope_model.cpp", document), IsEmpty());
  EXPECT_THAT(layers("core/microscope/simulation/a.cpp", document), SizeIs(1));
  EXPECT_THAT(layers("core/statistics/a.cpp", document), SizeIs(1));
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

TEST(CheckFunctionLength, LeavesTypesAndTablesAlone) {
  for (const std::string head : {"struct A", "namespace a", "int a[] =", "enum class A"}) {
    EXPECT_THAT(check_function_length({"a.cpp", function_of(200, head)}), IsEmpty()) << head;
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

TEST(CheckElementaryFunctions, AllowsExactOnesAndOurOwn) {
  for (const std::string call : {"std::sqrt(x)", "std::abs(x)", "std::floor(x)", "sincos(x)",
                                 "exponential(x)", "a.log(x)", "// std::sin(x)", "my_exp(x)"}) {
    EXPECT_THAT(check_elementary_functions({"core/a.cpp", call}), IsEmpty()) << call;
  }
}

TEST(CheckWords, CatchesBannedWordsInsideIdentifiers) {
  for (const std::string name : {"job", "num_tasks", "TaskQueue", "masterKey", "trial_",
                                 "node_count", "slave1 = slaves", "StoreManager"}) {
    EXPECT_THAT(check_words({"a.cpp", name}), ::testing::Not(IsEmpty())) << name;
  }
}

TEST(CheckWords, AllowsOrdinaryWordsCommentsAndForeignNames) {
  for (const std::string text : {"denoted", "multitasking", "// a node", "\"job\"",
                                 "const toml::node* found", "toml::at_path(a, b).node()"}) {
    EXPECT_THAT(check_words({"a.cpp", text}), IsEmpty()) << text;
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
