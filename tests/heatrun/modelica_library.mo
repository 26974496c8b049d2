package Modelica "Stands in for those parts of the Modelica Standard Library 4 that an export uses: the same
  names, ports and equations"
  package Units
    package SI
      type HeatCapacity = Real(final quantity = "HeatCapacity", final unit = "J/K");
      type ThermalResistance = Real(final quantity = "ThermalResistance", final unit = "K/W");
      type ThermalConductance = Real(final quantity = "ThermalConductance", final unit = "W/K");
      type HeatFlowRate = Real(final quantity = "Power", final unit = "W");
      type Temperature = Real(final quantity = "ThermodynamicTemperature", final unit = "K", min = 0.0, start = 288.15);
      type TemperatureDifference = Real(final quantity = "ThermodynamicTemperature", final unit = "K");
      type Resistance = Real(final quantity = "Resistance", final unit = "Ohm");
      type Power = Real(final quantity = "Power", final unit = "W");
    end SI;
  end Units;
  package Blocks
    package Interfaces
      connector RealInput = input Real;
      connector RealOutput = output Real;
    end Interfaces;
  end Blocks;
  package Thermal
    package HeatTransfer
      package Interfaces
        partial connector HeatPort
          Modelica.Units.SI.Temperature T;
          flow Modelica.Units.SI.HeatFlowRate Q_flow;
        end HeatPort;
        connector HeatPort_a
          extends HeatPort;
        end HeatPort_a;
        connector HeatPort_b
          extends HeatPort;
        end HeatPort_b;
        partial model Element1D
          Modelica.Units.SI.HeatFlowRate Q_flow;
          Modelica.Units.SI.TemperatureDifference dT;
          HeatPort_a port_a;
          HeatPort_b port_b;
        equation
          dT = port_a.T - port_b.T;
          port_a.Q_flow = Q_flow;
          port_b.Q_flow = -Q_flow;
        end Element1D;
      end Interfaces;
      package Components
        model HeatCapacitor
          parameter Modelica.Units.SI.HeatCapacity C;
          Modelica.Units.SI.Temperature T(start = 293.15);
          Interfaces.HeatPort_a port;
        equation
          T = port.T;
          C*der(T) = port.Q_flow;
        end HeatCapacitor;
        model ThermalResistor
          extends Interfaces.Element1D;
          parameter Modelica.Units.SI.ThermalResistance R;
        equation
          dT = R*Q_flow;
        end ThermalResistor;
        model Convection
          Modelica.Units.SI.HeatFlowRate Q_flow;
          Modelica.Units.SI.TemperatureDifference dT;
          Modelica.Blocks.Interfaces.RealInput Gc(unit = "W/K");
          Interfaces.HeatPort_a solid;
          Interfaces.HeatPort_b fluid;
        equation
          dT = solid.T - fluid.T;
          solid.Q_flow = Q_flow;
          fluid.Q_flow = -Q_flow;
          Q_flow = Gc*dT;
        end Convection;
      end Components;
      package Sources
        model PrescribedTemperature
          Interfaces.HeatPort_b port;
          Modelica.Blocks.Interfaces.RealInput T(unit = "K");
        equation
          port.T = T;
        end PrescribedTemperature;
        model PrescribedHeatFlow
          Modelica.Blocks.Interfaces.RealInput Q_flow(unit = "W");
          Interfaces.HeatPort_b port;
        equation
          port.Q_flow = -Q_flow;
        end PrescribedHeatFlow;
      end Sources;
    end HeatTransfer;
  end Thermal;
end Modelica;
