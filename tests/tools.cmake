roadvec_test(tools_simulate tests/tools/simulate LINKS tools_simulate drivers_can drivers_imu nlohmann_json::nlohmann_json)
roadvec_test(tools_score tests/tools/score LINKS tools_score)
