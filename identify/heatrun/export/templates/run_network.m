% RUN_NETWORK  Integrate the thermal network that lies in network.mat beside this script.
%
%   In MATLAB or GNU Octave, in this folder:   run_network
%   From a terminal:                           octave-cli run_network.m
%
% Each node i:   C(i) dT(i)/dt = heat(i) - flows out of it + flows into it
% Each link:     flow = g (T(first end) - T(second end)),   g = 1/R
% Copper loss:   Pjs = phases Rs0 Is^2 (B + T)/(B + Tref), T of the copper node
% Other losses:  losses = 'balance': Pol = Pd - Pjs;   losses = 'map': Pol as measured
%                share(i) of them heats node i.
% Losses by speed (speed_loss) heat a node of their own; of a balance, Pol is what they leave.
% Effects change this balance, add nodes, or change what the sensor reads, each by the law that
% stands below under its name. They act in the order of the file.
%
% Writes network_course.csv (temperatures of all nodes and the reading, at the samples) and prints
% the RMSE of the reading to Tw_m at the samples.
% No toolbox is needed. Units: s, A, W, degC, rpm, J/K, K/W, ohm.

folder = fileparts(mfilename('fullpath'));
p = load(fullfile(folder, 'network.mat'));
names = reshape(p.nodes, 1, []);
pairs = p.links;
C = p.capacitance(:);
R = p.resistance(:);
share = p.share(:);
start = p.start(:);
effects = p.effects;
is_balance = strcmp(p.losses, 'balance');
made = repmat({''}, 1, numel(effects));  % the node that each effect adds

% Effects that add nodes. What is left at the value where an effect vanishes keeps 0/0 away.
for e = 1:numel(effects)
  q = effects{e}.parameters;
  switch effects{e}.id
    case 'neighbour_body'
      at = effects{e}.node;
      new = 'neighbour';
      added = q.C + 1e-9;
      resistance = q.tau/added;
    case 'rotor_node'
      at = effects{e}.node;
      new = 'rotor';
      resistance = q.rise/(q.P + 1e-9);
      added = q.tau/resistance;
    case 'housing_node'
      at = effects{e}.link{1};
      new = 'housing';
      whole = R(strcmp(pairs(:, 1), at) & strcmp(pairs(:, 2), effects{e}.link{2}));
      resistance = (1 - q.x)*whole/(q.x + 1e-12);
      added = q.tau/resistance;
    case 'end_winding_node'
      at = p.copper_node;
      new = 'overhang';
      slots = strcmp(names, at);
      added = (q.f + 1e-12)*C(slots);
      C(slots) = (1 - q.f)*C(slots);
      resistance = q.tau/added;
    case 'winding_node'
      % one node becomes two; a winding has at most 0.3 of the capacity
      at = '';
      product = 1/max(q.x*R*C/q.tau, 1/(0.3*(1 - 0.3)));
      part = 0.5*(1 - sqrt(1 - 4*product));
      R = [q.tau/(product*C); R];
      C = [part*C; (1 - part)*C];
      names = {p.copper_node, 'stator'};
      pairs = {p.copper_node, 'stator'; 'stator', p.sink};
      share = [0; share];
      start = [start; start];
    otherwise
      at = '';
  end
  if ~isempty(at)
    made{e} = new;
    start = [start; start(strcmp(names, at))];
    names{end + 1} = new;
    C = [C; added];
    share = [share; 0];
    pairs = [pairs; {at, new}];
    R = [R; resistance];
  end
end

% Numbers of nodes and links; the sinks are the last entries of [T; sink; second sink].
has_second = isfield(p, 'second_sink');
num_nodes = numel(names);
num_links = numel(R);
first = zeros(num_links, 1);
second = zeros(num_links, 1);
into = zeros(num_nodes, num_links);
for l = 1:num_links
  first(l) = find(strcmp(names, pairs{l, 1}));
  into(first(l), l) = -1;
  if strcmp(pairs{l, 2}, p.sink)
    second(l) = num_nodes + 1;
  elseif has_second && strcmp(pairs{l, 2}, p.second_sink)
    second(l) = num_nodes + 2;
  else
    second(l) = find(strcmp(names, pairs{l, 2}));
    into(second(l), l) = 1;
  end
end
copper = find(strcmp(names, p.copper_node));
winding = find(strcmp(names, 'winding'));
place = zeros(1, numel(effects));  % node or link that each effect acts on
own = zeros(1, numel(effects));    % node that it adds
acting = 1:numel(effects);
for e = 1:numel(effects)
  if isfield(effects{e}, 'link')
    ab = effects{e}.link;
    place(e) = find(strcmp(pairs(:, 1), ab{1}) & strcmp(pairs(:, 2), ab{2}));
  elseif isfield(effects{e}, 'node')
    place(e) = find(strcmp(names, effects{e}.node));
  end
  if ~isempty(made{e})
    own(e) = find(strcmp(names, made{e}));
  end
  if strcmp(effects{e}.id, 'winding_node')
    own(e) = find(strcmp(names, 'stator'));
    acting = [acting(acting ~= e), e];  % it looks at the whole balance, so it acts last
  end
end

% One row per sample: time, squared current, losses, sink, speed [rad/s], coolant, fan, second
% sink. The square runs straight from sample to sample, because it is what heats.
t = p.t - p.t(1);
num_samples = numel(t);
x = zeros(num_samples, 8);
x(:, 1) = t;
x(:, 2) = p.Is.^2;
if is_balance
  x(:, 3) = p.Pd;
else
  x(:, 3) = p.Pol;
end
x(:, 4) = p.Te;
if isfield(p, 'speed_rpm')
  x(:, 5) = p.speed_rpm*pi/30;
end
if isfield(p, 'coolant_degC')
  x(:, 6) = p.coolant_degC;
end
if isfield(p, 'fan')
  x(:, 7) = p.fan;
end
if has_second
  x(:, 8) = p.Te2;
end
rated_speed = p.rated_speed_rpm*pi/30;
rated_current = p.rated_current_A;
k = p.phases*p.Rs0/(p.B + p.Tref);

% Classical Runge-Kutta (ode4 in Simulink). The step is the sampling interval, split evenly where
% that is longer than a twentieth of the fastest time constant, and into 20 where the machine
% stops or turns around: powers of the speed have a kink at standstill.
g0 = 1./R;
fastest = 1/max((abs(into)*g0)./C);
parts = max(1, ceil(diff(t)/(fastest/20)));
turns = x(1:end - 1, 5).*x(2:end, 5) <= 0 & x(1:end - 1, 5) ~= x(2:end, 5);
parts(turns) = max(parts(turns), 20);
num_steps = sum(parts);
at_sample = [1; 1 + cumsum(parts)];
time = zeros(num_steps + 1, 1);
sink_at = x(1, 4)*ones(num_steps + 1, 1);
course = zeros(num_steps + 1, num_nodes);
S = zeros(num_steps + 1, num_nodes);  % slopes at the steps
course(1, :) = start';
now = start;
row = 1;
reach = [0, 0.5, 0.5, 1];
weight = [1, 2, 2, 1]/6;
for i = 1:num_samples - 1
  h = (t(i + 1) - t(i))/parts(i);
  change = (x(i + 1, :) - x(i, :))/parts(i);
  for j = 1:parts(i)
    before = x(i, :) + (j - 1)*change;
    slope = zeros(num_nodes, 1);
    mean_slope = zeros(num_nodes, 1);
    for stage = 1:4
      T = now + reach(stage)*h*slope;
      y = before + reach(stage)*change;
      Pjs = k*y(2)*(p.B + T(copper));
      Pol = y(3);
      if is_balance
        Pol = y(3) - Pjs;
      end
      sink = y(4);
      omega = abs(y(5));
      s = omega/rated_speed;
      i2 = y(2)/rated_current^2;
      % a loss over itself at rated speed and current; with the current, a locked rotor has it too
      at_load = @(n, m) max((1 - m)*(s > 0)*s^n + m*i2*max(s, 0.01)^n, 0);
      heat = share*Pol;
      heat(copper) = heat(copper) + Pjs;
      g = g0;
      for e = acting
        q = effects{e}.parameters;
        n = place(e);
        in_copper = 0;   % heat that the copper gains; under a balance the other losses lose it
        in_other = 0;    % heat put in where the other losses go
        switch effects{e}.id
          case 'radiation'
            heat(n) = heat(n) - 5.670374419e-8*q.eA*((T(n) + 273.15)^4 - (sink + 273.15)^4);
          case 'natural_convection'
            far = [T; sink; y(8)];
            theta = T(first(n)) - far(second(n));
            g(n) = g(n)*(1 - q.f + q.f*((theta^2 + 1)/40^2)^(0.5*q.n));
          case 'speed_cooling'
            g(n) = g(n)*(1 + q.g*(s > 0)*s^q.m);
          case 'fan_cooling'
            g(n) = g(n)*(1 + q.g*y(7));
          case 'cooling_step'
            g(n) = g(n)*(1 + (q.k - 1)*0.5*(1 + tanh(0.5*(y(1) - q.t_star)/15)));
          case 'coolant_sink'
            sink = sink + q.a*(y(6) - sink);
          case 'ambient_drift'
            sink = sink + q.d*q.tau*(1 - exp(-y(1)/(3600*q.tau)));
          case 'ambient_recirculation'
            sink = sink + q.r*(Pjs + Pol);
          case 'rotor_node'
            in_other = -(q.P + 1e-9)*at_load(q.n, q.m);
            heat(own(e)) = heat(own(e)) - in_other;
          case 'end_winding_node'
            part = (q.f + 1e-12)*Pjs;
            in_copper = part*(T(own(e)) - T(copper))/(p.B + T(copper));
            heat(copper) = heat(copper) - (part + in_copper);
            heat(own(e)) = heat(own(e)) + (part + in_copper);
          case 'ac_copper_loss'
            in_copper = q.k*Pjs*s^2*((p.B + p.Tref)/(p.B + T(copper)))^2;
          case 'iron_loss_in_winding'
            in_other = -q.k*at_load(q.n, q.m);
            heat(copper) = heat(copper) - in_other;
          case 'external_loss'
            in_other = -q.k*Pol*(s > 0)*s^q.m;
          case 'bearing_friction'
            heat(n) = heat(n) + q.T_f*omega*exp(-q.kappa*(T(n) - sink));
          case 'stray_load_loss'
            watts = q.k*at_load(1.5, 1);
            in_copper = is_balance*watts;
            in_other = ~is_balance*watts;
          case 'speed_loss'
            rate = omega/(1000*pi/30);
            watts = q.linear*rate + q.square*rate^2;
            heat(n) = heat(n) + watts;
            in_other = -is_balance*watts;
            Pol = Pol - is_balance*watts;
          case 'standby_loss'
            in_other = q.P0;
          case 'loss_gain'
            in_other = q.g*(Pol + is_balance*Pjs);
          case 'insulation_conductivity'
            g(n) = g(n)*(1 + q.b*(T(first(n)) - 60));
          case 'contact_drift'
            g(n) = g(n)/(1 + q.d*y(1)/3600);
          case 'copper_coefficient'
            other_B = p.B + q.dB;
            ratio = (other_B + T(copper))*(p.B + p.Tref)/((other_B + p.Tref)*(p.B + T(copper)));
            in_copper = (ratio - 1)*Pjs;
          case 'winding_resistance'
            in_copper = q.g*Pjs;
          case 'winding_node'
            % below the smallest resistance of a machine, winding and body keep together
            body = own(e);
            both = C(copper) + C(body);
            outer = R(first == body & second == num_nodes + 1);
            held = 1 - min(1, 0.3*(1 - 0.3)*q.x*outer*both/q.tau);
            if held > 0
              with_sink = [T; sink; y(8)];
              flow = g.*(T(first) - with_sink(second));
              flow(first == copper & second == body) = 0;
              gained = heat + into*flow;
              moved = held*(C(body)*gained(copper) - C(copper)*gained(body))/both;
              heat(copper) = heat(copper) - moved;
              heat(body) = heat(body) + moved;
            end
          case {'neighbour_body', 'housing_node', 'sensor_lag', 'sensor_contact', ...
              'sensor_gain', 'sensor_pickup', 'time_shift'}
            % nothing in the balance
          otherwise
            error('The law of the effect %s is not in this script.', effects{e}.id);
        end
        heat = heat + (in_other - is_balance*in_copper)*share;
        heat(copper) = heat(copper) + in_copper;
      end
      with_sink = [T; sink; y(8)];
      slope = (heat + into*(g.*(T(first) - with_sink(second))))./C;
      mean_slope = mean_slope + weight(stage)*slope;
      if stage == 1
        S(row, :) = slope';
      end
    end
    now = now + h*mean_slope;
    row = row + 1;
    course(row, :) = now';
    S(row, :) = slope';  % overwritten by the next step
    time(row) = t(i) + j*h;
    sink_at(row) = before(4) + change(4);
  end
end

% The sensor. It lags or is late by a part of a step, so the straight lines between which it
% reads are made finer than the steps, along the cubic through temperatures and slopes.
lines = 1;
for e = 1:numel(effects)
  if any(strcmp(effects{e}.id, {'sensor_lag', 'time_shift'}))
    lines = min(40, max(1, ceil(max(diff(time))/0.02)));
  end
end
u = (0:lines - 1)/lines;
h = diff(time);
T = zeros(num_steps*lines + 1, num_nodes);
for n = 1:num_nodes
  a = course(1:end - 1, n);
  b = course(2:end, n);
  cubic = a*(1 - 3*u.^2 + 2*u.^3) + b*(3*u.^2 - 2*u.^3) ...
    + (h.*S(1:end - 1, n))*(u - 2*u.^2 + u.^3) + (h.*S(2:end, n))*(u.^3 - u.^2);
  T(:, n) = [reshape(cubic', [], 1); b(end)];
end
fine = [reshape((time(1:end - 1)*ones(1, lines) + h*u)', [], 1); time(end)];
sink = interp1(time, sink_at, fine);
at = strcmp(names, p.sensor.node);
reading = T(:, at) + p.sensor.gain*(T(:, at) - sink) + p.sensor.offset;
for e = 1:numel(effects)
  q = effects{e}.parameters;
  switch effects{e}.id
    case 'end_winding_node'
      reading = reading + q.p*(T(:, own(e)) - T(:, winding));
    case 'sensor_contact'
      reading = reading + q.k*(T(:, place(e)) - T(:, winding));
    case 'sensor_gain'
      reading = reading + q.g*(reading - sink);
    case 'sensor_pickup'
      square = interp1(t, x(:, 2), fine)/rated_current^2;
      reading = reading + q.p*square.^(q.n/2);
    case 'time_shift'
      reading = interp1(fine, reading, min(max(fine - q.d, 0), fine(end)));
    case 'sensor_lag'
      ratio = diff(fine)./(q.tau + 1e-9*diff(fine));
      decay = exp(-ratio);
      lag = -expm1(-ratio)./ratio;
      drawn = (lag - decay).*reading(1:end - 1) + (1 - lag).*reading(2:end);
      for i = 1:numel(decay)
        reading(i + 1) = decay(i)*reading(i) + drawn(i);
      end
  end
end
T = course(at_sample, :);
reading = reading((at_sample - 1)*lines + 1);

file = fullfile(folder, 'network_course.csv');
output = fopen(file, 'w');
if output < 0
  error('The file %s cannot be written: choose a writable folder.', file);
end
fprintf(output, '%s,', 'time_s');
fprintf(output, '%s_degC,', names{:});
fprintf(output, '%s\n', 'reading_degC');
fprintf(output, ['%.10g', repmat(',%.6f', 1, num_nodes + 1), '\n'], [p.t, T, reading]');
fclose(output);

is_read = isfinite(p.Tw_m);
rmse = sqrt(mean((reading(is_read) - p.Tw_m(is_read)).^2));
fprintf('RMSE of the reading to Tw_m: %.4f K over %d readings\n', rmse, sum(is_read));
