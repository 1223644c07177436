#include <sanitizer/common_interface_defs.h>

#include <algorithm>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

// Runs a fuzz target where there is no libFuzzer: on the seeds as they are, then on mutations of them, each made from
// its number alone, so that any of them can be had again.
//
//   fuzz_dbc CORPUS_DIR FIRST COUNT
namespace {

constexpr std::size_t kMostBytes = 4096;
constexpr std::uint8_t kTelling[] = {0, 1, 0x7F, 0x80, 0xFF, '\n', '"', '-'};

const char* program = "";
unsigned long long number = 0;

void name_the_input() {
  std::fprintf(stderr, "%s: failed at input %llu; again: %s CORPUS_DIR %llu 1\n", program, number, program, number);
}

void mutate(std::string& input, const std::vector<std::string>& seeds, std::mt19937_64& random) {
  const auto below = [&](std::size_t limit) { return limit == 0 ? 0 : random() % limit; };
  const std::size_t at = below(input.size());
  const std::size_t length = 1 + below(std::min<std::size_t>(input.size() - at, 32));
  const std::string& other = seeds[below(seeds.size())];
  switch (random() % 6) {
    case 0:
      if (!input.empty()) input[at] = static_cast<char>(input[at] ^ (1 << random() % 8));
      break;
    case 1:
      input.replace(at, input.empty() ? 0 : 1, 1, static_cast<char>(kTelling[random() % std::size(kTelling)]));
      break;
    case 2:
      input.erase(at, length);
      break;
    case 3:
      input.insert(below(input.size()), input.substr(at, length));
      break;
    case 4:
      input.insert(at, other.substr(below(other.size()), length));
      break;
    default:
      input.resize(at);
  }
  input.resize(std::min(input.size(), kMostBytes));
}

std::vector<std::string> read_files(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> paths(std::filesystem::directory_iterator(folder), {});
  std::ranges::sort(paths);
  std::vector<std::string> contents;
  for (const auto& path : paths) {
    std::ifstream file(path, std::ios::binary);
    contents.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  }
  return contents;
}

}  // namespace

int main(int argc, char** argv) {
  program = argv[0];
  if (argc != 4) {
    std::fprintf(stderr, "usage: %s CORPUS_DIR FIRST COUNT\n", program);
    return 2;
  }
  const std::vector<std::string> seeds = read_files(argv[1]);
  if (seeds.empty()) {
    std::fprintf(stderr, "%s: no seeds in %s\n", program, argv[1]);
    return 2;
  }
  __sanitizer_set_death_callback(name_the_input);
  std::signal(SIGABRT, [](int) { name_the_input(); });
  const unsigned long long first = std::strtoull(argv[2], nullptr, 10),
                           end = first + std::strtoull(argv[3], nullptr, 10);
  for (number = first; number < end; ++number) {
    std::string input = seeds[number % seeds.size()];
    std::mt19937_64 random(number);
    for (auto rounds = number < seeds.size() ? 0 : 1 + random() % 8; rounds > 0; --rounds) mutate(input, seeds, random);
    LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(input.data()), input.size());
  }
  std::printf("%llu inputs\n", end - first);
}
