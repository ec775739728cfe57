#pragma once

#include <memory>

namespace CLI {
class FormatterBase;
}

namespace gimnet::tool {

/// How help is laid out: commands in a line each, and options without the types and ranges that
/// their descriptions say in words. Thread safety: immutable.
[[nodiscard]] std::shared_ptr<CLI::FormatterBase> help_format();

}  // namespace gimnet::tool
