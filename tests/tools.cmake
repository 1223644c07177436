roadvec_test(tools_simulate tests/tools/simulate LINKS tools_simulate_lib drivers_can drivers_imu nlohmann_json::nlohmann_json)
roadvec_test(tools_score tests/tools/score LINKS tools_score_lib)
