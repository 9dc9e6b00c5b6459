#pragma once

namespace CLI {
class App;
}

namespace flamefield {

class Session;

void add_plan(CLI::App& app, Session& session);

}  // namespace flamefield
