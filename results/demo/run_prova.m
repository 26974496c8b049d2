% RUN_PROVA  Integrate the thermal network that lies in prova.mat beside this script.
%
%   In MATLAB or GNU Octave, in this folder:   run_prova
%   From a terminal:                           octave-cli run_prova.m
%
% Second order (prova.mat has Ceqsr):
%   Ceqw  dTw/dt = Pjs - (Tw - Ts)/Reqw
%   Ceqsr dTs/dt = Pd - Pjs + (Tw - Ts)/Reqw - (Ts - Te)/Reqsr
%   Pjs = Rrif Is^2 (B + Tw)/(B + Trif),   Rrif = 3 Rs0
% First order:
%   Ceqw  dTw/dt = Pd - (Tw - Te)/Reqw
%
% Writes prova_course.csv (temperatures at the samples) and prints the RMSE of Tw to Tw_m.
% No toolbox is needed. Units: s, A, W, degC, J/K, K/W, ohm.

folder = fileparts(mfilename('fullpath'));
p = load(fullfile(folder, 'prova.mat'));
Ceqw = p.Ceqw;
Reqw = p.Reqw;

% One row per sample: squared current, losses, sink. The square runs straight from sample to
% sample, because it is what heats.
x = [p.Is.^2, p.Pd, p.Te];

if isfield(p, 'Ceqsr')
  Ceqsr = p.Ceqsr;
  Reqsr = p.Reqsr;
  B = p.B;
  k = p.Rrif/(p.B + p.Trif);
  slope = @(T, x) [(k*x(1)*(B + T(1)) - (T(1) - T(2))/Reqw)/Ceqw, ...
    (x(2) - k*x(1)*(B + T(1)) + (T(1) - T(2))/Reqw - (T(2) - x(3))/Reqsr)/Ceqsr];
  fastest = 1/max(1/(Reqw*Ceqw), (1/Reqw + 1/Reqsr)/Ceqsr);
  start = [p.Two, p.Tso];
  header = 'time_s,winding_degC,stator_degC';
else
  slope = @(T, x) (x(2) - (T - x(3))/Reqw)/Ceqw;
  fastest = Reqw*Ceqw;
  start = p.Two;
  header = 'time_s,winding_degC';
end

% Classical Runge-Kutta (ode4 in Simulink). The step is the sampling interval, split evenly where
% that is longer than a twentieth of the fastest time constant.
num_samples = numel(p.t);
parts = max(1, ceil(diff(p.t)/(fastest/20)));
T = zeros(num_samples, numel(start));
T(1, :) = start;
now = start;
for i = 1:num_samples - 1
  h = (p.t(i + 1) - p.t(i))/parts(i);
  change = (x(i + 1, :) - x(i, :))/parts(i);
  for j = 1:parts(i)
    before = x(i, :) + (j - 1)*change;
    middle = before + 0.5*change;
    s1 = slope(now, before);
    s2 = slope(now + 0.5*h*s1, middle);
    s3 = slope(now + 0.5*h*s2, middle);
    s4 = slope(now + h*s3, before + change);
    now = now + h/6*(s1 + 2*s2 + 2*s3 + s4);
  end
  T(i + 1, :) = now;
end

file = fullfile(folder, 'prova_course.csv');
output = fopen(file, 'w');
if output < 0
  error('The file %s cannot be written: choose a writable folder.', file);
end
fprintf(output, '%s\n', header);
fprintf(output, ['%.10g', repmat(',%.6f', 1, size(T, 2)), '\n'], [p.t, T]');
fclose(output);

is_read = isfinite(p.Tw_m);
rmse = sqrt(mean((T(is_read, 1) - p.Tw_m(is_read)).^2));
fprintf('RMSE of Tw to Tw_m: %.4f K over %d readings\n', rmse, sum(is_read));
