% BUILD_MODELS  Build the Simulink models of the thesis from base blocks.
%
%   In MATLAB with Simulink, R2018a or newer, in this folder:   build_models
%
% Writes beside this script
%   Second_Order_Thermal_Motor_Model.slx   winding and stator (prova.mat has Ceqsr)
%   First_Order_Thermal_Motor_Model.slx    one body (prova.mat has no Ceqsr)
% A model of that name that is there already is kept as .slx.bak.
%
% A model loads prova.mat from its own folder when it starts. Open the one that prova.mat is for
% and press Run: the scope shows Tw beside Tw_m; Tw_sim (and Ts_sim, Pjs_sim) are timeseries in the
% workspace. For another test, put its prova.mat here and type build_models again: step and end of
% the simulation are those of its samples.
%
% The equations are those of run_prova.m. The squared current runs straight from sample to sample,
% because it is what heats. Units: s, A, W, degC, J/K, K/W, ohm.
%
% heatrun checks the structure of these models and integrates them block by block in a program of
% its own. This script itself has never been run in MATLAB.

folder = fileparts(mfilename('fullpath'));
p = load(fullfile(folder, 'prova.mat'));
is_measured = any(isfinite(p.Tw_m));
readings = '[t(isfinite(Tw_m)), Tw_m(isfinite(Tw_m))]';

% The step is the sampling interval, or a twentieth of the fastest time constant if that is shorter.
fastest = p.Reqw*p.Ceqw;
if isfield(p, 'Ceqsr')
  fastest = 1/max(1/(p.Reqw*p.Ceqw), (1/p.Reqw + 1/p.Reqsr)/p.Ceqsr);
end
span = p.t(end) - p.t(1);
num_steps = ceil(span/min(median(diff(p.t)), fastest/20));
times = {'StartTime', sprintf('%.17g', p.t(1)), 'StopTime', sprintf('%.17g', p.t(end)), ...
  'FixedStep', sprintf('%.17g', span/num_steps)};
load_system('simulink');

% Second order
%   Ceqw  dTw/dt = Pjs - Pws,              Pjs = Rrif Is^2 (B + Tw)/(B + Trif)
%   Ceqsr dTs/dt = Pd - Pjs + Pws - Pse,   Pws = (Tw - Ts)/Reqw, Pse = (Ts - Te)/Reqsr
m = 'Second_Order_Thermal_Motor_Model';
if bdIsLoaded(m)
  close_system(m, 0);
end
new_system(m);
add_block('simulink/Sources/From Workspace', [m '/Is squared'], 'VariableName', '[t, Is.^2]', ...
  'SampleTime', '0', 'Interpolate', 'on', 'OutputAfterFinalValue', 'Holding final value', ...
  'Position', [30 40 110 70]);
add_block('simulink/Sources/From Workspace', [m '/Pd'], 'VariableName', '[t, Pd]', ...
  'SampleTime', '0', 'Interpolate', 'on', 'OutputAfterFinalValue', 'Holding final value', ...
  'Position', [30 260 110 290]);
add_block('simulink/Sources/From Workspace', [m '/Te'], 'VariableName', '[t, Te]', ...
  'SampleTime', '0', 'Interpolate', 'on', 'OutputAfterFinalValue', 'Holding final value', ...
  'Position', [30 420 110 450]);
add_block('simulink/Sources/Constant', [m '/B'], 'Value', 'B', 'Position', [30 120 110 150]);
add_block('simulink/Math Operations/Sum', [m '/B + Tw'], 'IconShape', 'rectangular', ...
  'Inputs', '++', 'Position', [160 115 190 165]);
add_block('simulink/Math Operations/Product', [m '/Is squared (B + Tw)'], 'Inputs', '2', ...
  'Position', [230 45 260 95]);
add_block('simulink/Math Operations/Gain', [m '/Pjs'], 'Gain', 'Rrif/(B + Trif)', ...
  'Position', [300 50 380 90]);
add_block('simulink/Math Operations/Sum', [m '/Pjs - Pws'], 'IconShape', 'rectangular', ...
  'Inputs', '+-', 'Position', [440 55 470 105]);
add_block('simulink/Math Operations/Gain', [m '/dTw per s'], 'Gain', '1/Ceqw', ...
  'Position', [510 60 590 100]);
add_block('simulink/Continuous/Integrator', [m '/Tw'], 'InitialCondition', 'Two', ...
  'Position', [640 60 680 100]);
add_block('simulink/Math Operations/Sum', [m '/Tw - Ts'], 'IconShape', 'rectangular', ...
  'Inputs', '+-', 'Position', [230 175 260 225]);
add_block('simulink/Math Operations/Gain', [m '/Pws'], 'Gain', '1/Reqw', ...
  'Position', [300 180 380 220]);
add_block('simulink/Math Operations/Sum', [m '/Heat of the stator'], ...
  'IconShape', 'rectangular', 'Inputs', '+-+-', 'Position', [440 255 470 345]);
add_block('simulink/Math Operations/Gain', [m '/dTs per s'], 'Gain', '1/Ceqsr', ...
  'Position', [510 280 590 320]);
add_block('simulink/Continuous/Integrator', [m '/Ts'], 'InitialCondition', 'Tso', ...
  'Position', [640 280 680 320]);
add_block('simulink/Math Operations/Sum', [m '/Ts - Te'], 'IconShape', 'rectangular', ...
  'Inputs', '+-', 'Position', [230 385 260 435]);
add_block('simulink/Math Operations/Gain', [m '/Pse'], 'Gain', '1/Reqsr', ...
  'Position', [300 390 380 430]);
add_block('simulink/Sinks/To Workspace', [m '/Tw_sim'], 'VariableName', 'Tw_sim', ...
  'SaveFormat', 'Timeseries', 'MaxDataPoints', 'inf', 'Position', [760 65 840 95]);
add_block('simulink/Sinks/To Workspace', [m '/Ts_sim'], 'VariableName', 'Ts_sim', ...
  'SaveFormat', 'Timeseries', 'MaxDataPoints', 'inf', 'Position', [760 285 840 315]);
add_block('simulink/Sinks/To Workspace', [m '/Pjs_sim'], 'VariableName', 'Pjs_sim', ...
  'SaveFormat', 'Timeseries', 'MaxDataPoints', 'inf', 'Position', [440 5 520 35]);
add_line(m, 'B/1', 'B + Tw/1', 'autorouting', 'on');
add_line(m, 'Tw/1', 'B + Tw/2', 'autorouting', 'on');
add_line(m, 'Is squared/1', 'Is squared (B + Tw)/1', 'autorouting', 'on');
add_line(m, 'B + Tw/1', 'Is squared (B + Tw)/2', 'autorouting', 'on');
add_line(m, 'Is squared (B + Tw)/1', 'Pjs/1', 'autorouting', 'on');
add_line(m, 'Pjs/1', 'Pjs - Pws/1', 'autorouting', 'on');
add_line(m, 'Pws/1', 'Pjs - Pws/2', 'autorouting', 'on');
add_line(m, 'Pjs - Pws/1', 'dTw per s/1', 'autorouting', 'on');
add_line(m, 'dTw per s/1', 'Tw/1', 'autorouting', 'on');
add_line(m, 'Tw/1', 'Tw - Ts/1', 'autorouting', 'on');
add_line(m, 'Ts/1', 'Tw - Ts/2', 'autorouting', 'on');
add_line(m, 'Tw - Ts/1', 'Pws/1', 'autorouting', 'on');
add_line(m, 'Pd/1', 'Heat of the stator/1', 'autorouting', 'on');
add_line(m, 'Pjs/1', 'Heat of the stator/2', 'autorouting', 'on');
add_line(m, 'Pws/1', 'Heat of the stator/3', 'autorouting', 'on');
add_line(m, 'Pse/1', 'Heat of the stator/4', 'autorouting', 'on');
add_line(m, 'Heat of the stator/1', 'dTs per s/1', 'autorouting', 'on');
add_line(m, 'dTs per s/1', 'Ts/1', 'autorouting', 'on');
add_line(m, 'Ts/1', 'Ts - Te/1', 'autorouting', 'on');
add_line(m, 'Te/1', 'Ts - Te/2', 'autorouting', 'on');
add_line(m, 'Ts - Te/1', 'Pse/1', 'autorouting', 'on');
add_line(m, 'Tw/1', 'Tw_sim/1', 'autorouting', 'on');
add_line(m, 'Ts/1', 'Ts_sim/1', 'autorouting', 'on');
add_line(m, 'Pjs/1', 'Pjs_sim/1', 'autorouting', 'on');
if is_measured
  add_block('simulink/Sources/From Workspace', [m '/Tw_m'], 'VariableName', readings, ...
    'SampleTime', '0', 'Interpolate', 'on', 'OutputAfterFinalValue', 'Holding final value', ...
    'Position', [640 150 720 180]);
  add_block('simulink/Signal Routing/Mux', [m '/Tw and Tw_m'], 'Inputs', '2', ...
    'Position', [760 120 765 180]);
  add_block('simulink/Sinks/Scope', [m '/Winding'], 'Position', [800 130 840 170]);
  add_line(m, 'Tw/1', 'Tw and Tw_m/1', 'autorouting', 'on');
  add_line(m, 'Tw_m/1', 'Tw and Tw_m/2', 'autorouting', 'on');
  add_line(m, 'Tw and Tw_m/1', 'Winding/1', 'autorouting', 'on');
end
set_param(m, 'SolverType', 'Fixed-step', 'Solver', 'ode4', times{:}, ...
  'ReturnWorkspaceOutputs', 'off');
set_param(m, 'InitFcn', ['clear Ceqsr Reqsr Tso; ' ...
  'load(fullfile(fileparts(get_param(''Second_Order_Thermal_Motor_Model'', ''FileName'')), ' ...
  '''prova.mat'')); if ~exist(''Ceqsr'', ''var''), ' ...
  'error(''prova.mat holds the first order: export with --model second.''); end']);
file = fullfile(folder, [m '.slx']);
if exist(file, 'file')
  movefile(file, [file '.bak']);
end
save_system(m, file);
close_system(m, 0);
fprintf('%s\n', file);

% First order
%   Ceqw dTw/dt = Pd - Pwe,   Pwe = (Tw - Te)/Reqw
m = 'First_Order_Thermal_Motor_Model';
if bdIsLoaded(m)
  close_system(m, 0);
end
new_system(m);
add_block('simulink/Sources/From Workspace', [m '/Pd'], 'VariableName', '[t, Pd]', ...
  'SampleTime', '0', 'Interpolate', 'on', 'OutputAfterFinalValue', 'Holding final value', ...
  'Position', [30 40 110 70]);
add_block('simulink/Sources/From Workspace', [m '/Te'], 'VariableName', '[t, Te]', ...
  'SampleTime', '0', 'Interpolate', 'on', 'OutputAfterFinalValue', 'Holding final value', ...
  'Position', [30 180 110 210]);
add_block('simulink/Math Operations/Sum', [m '/Tw - Te'], 'IconShape', 'rectangular', ...
  'Inputs', '+-', 'Position', [160 145 190 195]);
add_block('simulink/Math Operations/Gain', [m '/Pwe'], 'Gain', '1/Reqw', ...
  'Position', [230 150 310 190]);
add_block('simulink/Math Operations/Sum', [m '/Pd - Pwe'], 'IconShape', 'rectangular', ...
  'Inputs', '+-', 'Position', [360 45 390 95]);
add_block('simulink/Math Operations/Gain', [m '/dTw per s'], 'Gain', '1/Ceqw', ...
  'Position', [430 50 510 90]);
add_block('simulink/Continuous/Integrator', [m '/Tw'], 'InitialCondition', 'Two', ...
  'Position', [560 50 600 90]);
add_block('simulink/Sinks/To Workspace', [m '/Tw_sim'], 'VariableName', 'Tw_sim', ...
  'SaveFormat', 'Timeseries', 'MaxDataPoints', 'inf', 'Position', [680 55 760 85]);
add_line(m, 'Tw/1', 'Tw - Te/1', 'autorouting', 'on');
add_line(m, 'Te/1', 'Tw - Te/2', 'autorouting', 'on');
add_line(m, 'Tw - Te/1', 'Pwe/1', 'autorouting', 'on');
add_line(m, 'Pd/1', 'Pd - Pwe/1', 'autorouting', 'on');
add_line(m, 'Pwe/1', 'Pd - Pwe/2', 'autorouting', 'on');
add_line(m, 'Pd - Pwe/1', 'dTw per s/1', 'autorouting', 'on');
add_line(m, 'dTw per s/1', 'Tw/1', 'autorouting', 'on');
add_line(m, 'Tw/1', 'Tw_sim/1', 'autorouting', 'on');
if is_measured
  add_block('simulink/Sources/From Workspace', [m '/Tw_m'], 'VariableName', readings, ...
    'SampleTime', '0', 'Interpolate', 'on', 'OutputAfterFinalValue', 'Holding final value', ...
    'Position', [560 150 640 180]);
  add_block('simulink/Signal Routing/Mux', [m '/Tw and Tw_m'], 'Inputs', '2', ...
    'Position', [680 120 685 180]);
  add_block('simulink/Sinks/Scope', [m '/Winding'], 'Position', [720 130 760 170]);
  add_line(m, 'Tw/1', 'Tw and Tw_m/1', 'autorouting', 'on');
  add_line(m, 'Tw_m/1', 'Tw and Tw_m/2', 'autorouting', 'on');
  add_line(m, 'Tw and Tw_m/1', 'Winding/1', 'autorouting', 'on');
end
set_param(m, 'SolverType', 'Fixed-step', 'Solver', 'ode4', times{:}, ...
  'ReturnWorkspaceOutputs', 'off');
set_param(m, 'InitFcn', ['clear Ceqsr Reqsr Tso; ' ...
  'load(fullfile(fileparts(get_param(''First_Order_Thermal_Motor_Model'', ''FileName'')), ' ...
  '''prova.mat'')); if exist(''Ceqsr'', ''var''), ' ...
  'error(''prova.mat holds the second order: export with --model first.''); end']);
file = fullfile(folder, [m '.slx']);
if exist(file, 'file')
  movefile(file, [file '.bak']);
end
save_system(m, file);
close_system(m, 0);
fprintf('%s\n', file);
